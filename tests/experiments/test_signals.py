"""SIGINT, SIGTERM and SIGKILL leave no worker, and no temporary folder once the next run has started."""

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

from furuta_gym.processes import temporary_folder

ROOT = Path(__file__).parents[2]
DATA = ROOT / "tests" / "data"
STOPS = 3

pytestmark = pytest.mark.skipif(os.name == "nt", reason="these signals are POSIX's")

BUSY = """
import os, sys, time
from joblib import Parallel, delayed
from experiments.workers import workers
from furuta_gym.processes import ending_in_order, temporary_folder

def work(n):
    os.write(1, b"%d\\n" % os.getpid())  # in one piece, as the other worker writes too
    time.sleep(300)

try:
    with ending_in_order(), workers("loky", 2), temporary_folder("test") as room:
        print(room, flush=True)
        Parallel()(delayed(work)(n) for n in range(2))
except KeyboardInterrupt:
    sys.exit(130)
"""


def running(process: int) -> bool:
    try:
        state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks at processes in /proc")
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGKILL"])
def test_no_worker_outlives_its_parent(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    environment = os.environ | {"TMPDIR": str(tmp_path)}
    process = subprocess.Popen(
        [sys.executable, "-c", BUSY],
        stdout=subprocess.PIPE,
        text=True,
        env=environment,
        # a shell lets what it runs in the background ignore SIGINT, and that is inherited
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    assert process.stdout is not None
    lines = [process.stdout.readline().strip() for _ in range(3)]
    room = next(line for line in lines if line.startswith("/"))
    found = [int(line) for line in lines if line.isdecimal()]
    assert len(found) == 2
    assert all(map(running, found))
    process.send_signal(getattr(signal, name))
    code = process.wait(timeout=60)
    process.stdout.close()
    assert code == {"SIGINT": 130, "SIGTERM": 143, "SIGKILL": -9}[name]
    late = time.monotonic() + 20.0
    while any(map(running, found)) and time.monotonic() < late:
        time.sleep(0.1)
    assert not any(map(running, found))
    assert Path(room).exists() == (name == "SIGKILL")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with temporary_folder("test") as own:
        assert not Path(room).exists()
        assert own.stat().st_mode & 0o777 == 0o700
    assert not own.exists()


def test_folders_of_the_living_stay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with temporary_folder("test") as first, temporary_folder("test") as second:
        assert first.exists()
        assert first != second


def test_ctrl_c_says_what_was_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from controllers.comparison import evaluation
    from tests.experiments.test_cli import furuta

    def stop(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(evaluation, "compare", stop)
    result = furuta("compare", "--plant", "qube", "-o", tmp_path / "out")
    assert result.exit_code == 130
    assert "Interrupted. Nothing was written" in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_stopped_diagnosis_keeps_its_search_and_no_result(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from identification.diagnosis import diagnose as module
    from identification.logs.log import write_log
    from tests.experiments.test_cli import furuta
    from tests.factories import made_log

    write_log(tmp_path / "log.csv", made_log())
    ends: list[BaseException] = [KeyboardInterrupt(), KeyboardInterrupt(), ValueError("no stretch of a second")]
    seen: list[bool] = []

    def stopped(*_: object, journal: Path, **asked: object) -> None:
        seen.append(journal.exists())
        if len(seen) > 1:
            journal.write_text("a fit\n")
        raise ends[len(seen) - 1]

    monkeypatch.setattr(module, "diagnose", stopped)
    before = sorted(tmp_path.iterdir())
    result = furuta("diagnose", tmp_path / "log.csv", "-o", tmp_path / "found")
    assert result.exit_code == 130
    assert "Interrupted. Nothing was written; results of an earlier run" in result.stderr, "before the first fit"
    assert sorted(tmp_path.iterdir()) == before
    result = furuta("diagnose", tmp_path / "log.csv", "-o", tmp_path / "found")
    assert result.exit_code == 130
    assert "the fits so far, in found.search.jsonl" in result.stderr
    assert "goes on from there" in result.stderr
    journal = tmp_path / "found.search.jsonl"
    assert sorted(tmp_path.iterdir()) == sorted([*before, journal])
    assert furuta("diagnose", tmp_path / "log.csv", "-o", tmp_path / "found").exit_code == 2
    assert seen == [False, False, True]
    assert sorted(tmp_path.iterdir()) == sorted([*before, journal]), "a refused command leaves what was kept"


@pytest.mark.thorough
@pytest.mark.timeout(3600)
def test_a_diagnosis_stopped_at_any_moment_goes_on_to_the_same_answer(tmp_path: Path) -> None:
    """The command itself, on a stranger's log: stopped by Ctrl-C or killed, and given again."""
    for name in ("versuch1.csv", "versuch2.csv"):
        shutil.copy(DATA / name, tmp_path / name)

    def started(*words: str) -> subprocess.Popen[bytes]:
        quiet = subprocess.DEVNULL
        return subprocess.Popen(
            [sys.executable, "-m", "furuta_command", *words],
            cwd=tmp_path,
            env=os.environ | {"PYTHONPATH": str(ROOT)},
            stdout=quiet,
            stderr=quiet,
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        )

    def diagnose(out: str) -> subprocess.Popen[bytes]:
        return started("diagnose", "versuch1.csv", "--held-out", "versuch2.csv", "-o", out)

    def answer(out: str) -> dict[str, object]:
        found = json.loads((tmp_path / out / "diagnosis.json").read_text(encoding="utf-8"))
        found.pop("runtime_s")
        return found

    assert started("init", "versuch1.csv").wait() == 0
    began = time.monotonic()
    assert diagnose("whole").wait() == 0
    whole, expected = time.monotonic() - began, answer("whole")
    draw = random.Random(18)
    for number in range(STOPS):
        moment, process = draw.uniform(0.1, 0.9) * whole, diagnose(f"stopped{number}")
        while _ended(process, moment):  # a machine may be faster than it was a minute ago
            shutil.rmtree(tmp_path / f"stopped{number}")
            moment, process = 0.5 * moment, diagnose(f"stopped{number}")
        process.send_signal(signal.SIGINT if number % 2 else signal.SIGKILL)
        assert process.wait() != 0
        assert not (tmp_path / f"stopped{number}").exists()
        assert diagnose(f"stopped{number}").wait() == 0
        assert answer(f"stopped{number}") == expected
        assert not (tmp_path / f"stopped{number}.search.jsonl").exists()


def _ended(process: subprocess.Popen[bytes], seconds: float) -> bool:
    """Whether a process ends within some time."""
    try:
        process.wait(seconds)
    except subprocess.TimeoutExpired:
        return False
    return True
