"""Results are replaced whole or not at all: killed, on a full disk, by two at once, and across file systems."""

import errno
import os
import random
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from experiments.cli.whole import whole_folder
from furuta_gym.files import locked, write_whole
from furuta_gym.plant import QUBE, Plant

ENDLESS = """
import sys
from pathlib import Path
from experiments.cli.whole import whole_folder
n = 0
while True:
    n += 1
    with whole_folder(Path(sys.argv[1]), ("a", "b", "c")) as folder:
        for name in ("a", "b", "c")[: 2 + n % 2]:
            (folder / name).write_text(f"{n} " * 2000)
    print(n, flush=True)
"""


def contents(folder: Path) -> dict[str, str]:
    return {file.name: file.read_text() for file in folder.iterdir()}


@pytest.mark.skipif(os.name == "nt", reason="kill -9 is POSIX's")
def test_killed_at_any_instant(tmp_path: Path) -> None:
    """Twelve kills: all files are of one run, and the next run works and leaves nothing beside."""
    target = tmp_path / "out"
    draw = random.Random(20)
    for _ in range(12):
        process = subprocess.Popen([sys.executable, "-c", ENDLESS, target], stdout=subprocess.PIPE)
        assert process.stdout is not None
        process.stdout.readline()
        time.sleep(draw.uniform(0.0, 0.05))
        process.send_signal(signal.SIGKILL)
        process.wait()
        process.stdout.close()
        found = contents(target)
        number = int(found["a"].split()[0])
        assert found == dict.fromkeys(("a", "b", "c")[: 2 + number % 2], f"{number} " * 2000)
    with whole_folder(target, ("a", "b", "c")) as folder:
        (folder / "a").write_text("last")
    assert contents(target) == {"a": "last"}
    assert os.listdir(tmp_path) == ["out"]


def full(*_: object) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_full_disk_keeps_the_old(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target = tmp_path / "out"
    with whole_folder(target) as folder:
        (folder / "a").write_text("old")
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match=f"No space left on device: '{target}'"), whole_folder(target) as folder:
        (folder / "a").write_text("new")
    plant = tmp_path / "rig.json"
    with pytest.raises(OSError, match=f"No space left on device: '{plant}'"):
        QUBE.save(plant)
    assert contents(target) == {"a": "old"}
    assert os.listdir(tmp_path) == ["out"]


def test_the_message_names_the_real_file(tmp_path: Path) -> None:
    target = tmp_path / "out"
    with pytest.raises(FileNotFoundError, match=f"'{target / 'none' / 'a'}'"), whole_folder(target) as folder:
        (folder / "none" / "a").write_text("x")
    (tmp_path / "folder").mkdir()
    with pytest.raises(OSError, match=f"'{tmp_path / 'folder'}'"):
        write_whole(tmp_path / "folder", "x")


def test_threads_that_write_one_file_do_not_disturb_each_other(tmp_path: Path) -> None:
    target, texts = tmp_path / "a.json", [str(i) * 20000 for i in range(8)]
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda i: write_whole(target, texts[i % 8]), range(60)))
    assert target.read_text() in texts
    assert os.listdir(tmp_path) == ["a.json"]


def test_other_files_stay(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    (tmp_path / "mine").write_text("mine")
    (tmp_path / "left").write_text("of an earlier run")
    with whole_folder(tmp_path, ("left", "a")) as folder:
        (folder / "a").write_text("new")
    assert sorted(os.listdir(tmp_path)) == ["a", "mine", "sub"]


def test_two_at_once(tmp_path: Path) -> None:
    with (
        locked(tmp_path / "out"),
        pytest.raises(ValueError, match=r"out is being written by another furuta"),
        whole_folder(tmp_path / "out"),
    ):
        pytest.fail("it went on")
    with whole_folder(tmp_path / "out") as folder:
        (folder / "a").touch()
    assert os.listdir(tmp_path) == ["out"]


def test_what_a_killed_swap_left_is_put_back(tmp_path: Path) -> None:
    """Where folders cannot be exchanged in one step, the old one has another name for an instant."""
    child = subprocess.Popen([sys.executable, "-c", ""])
    child.wait()
    from furuta_gym import files

    old = tmp_path / f".out.{files._host()}-{child.pid}.old"
    old.mkdir()
    (old / "a").write_text("old")
    with pytest.raises(RuntimeError), whole_folder(tmp_path / "out", ["a"]):
        raise RuntimeError
    assert contents(tmp_path / "out") == {"a": "old"}


def test_a_plant_is_written_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = QUBE.save(tmp_path / "rig.json")
    synced: list[int] = []
    monkeypatch.setattr(os, "fsync", synced.append)
    QUBE.replace(u_max=3.0).save(path)
    assert len(synced) == 2  # the file and its folder
    assert Plant.load(path).u_max == 3.0
    assert os.listdir(tmp_path) == ["rig.json"]


def test_a_log_is_written_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every format: the file that stood there stays, and the message names it."""
    from identification.logs.formats import WRITERS
    from identification.logs.log import write_log
    from tests.factories import made_log

    for ending in WRITERS:
        path = tmp_path / f"log{ending}"
        write_log(path, made_log())
        before = path.read_bytes()
        with monkeypatch.context() as patch:
            patch.setattr(os, "fsync", full)
            with pytest.raises(OSError, match=f"No space left on device: '{path}'"):
                write_log(path, made_log(300))
        assert path.read_bytes() == before
    assert sorted(os.listdir(tmp_path)) == sorted(f"log{ending}" for ending in WRITERS)


def test_folders_in_a_folder(tmp_path: Path) -> None:
    """Replaced with what is in them, beside files of the user and without any."""
    for mine in ([], ["mine"]):
        for name in mine:
            (tmp_path / "out" / name).touch()
        for text in ("old", "new"):
            with whole_folder(tmp_path / "out", ["sub", "a"]) as folder:
                (folder / "sub").mkdir()
                (folder / "sub" / text).touch()
                (folder / "a").write_text(text)
        assert sorted(os.listdir(tmp_path / "out")) == ["a", *mine, "sub"]
        assert os.listdir(tmp_path / "out" / "sub") == ["new"]
    with whole_folder(tmp_path / "out", ["sub", "a"]) as folder:
        (folder / "a").write_text("alone")
    assert sorted(os.listdir(tmp_path / "out")) == ["a", "mine"]
    assert os.listdir(tmp_path) == ["out"]


def test_the_demo_is_written_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One that stops half-way leaves the files of the one before."""
    from experiments.demo import story
    from tests.commands import furuta

    def runs(text: str, stop: bool):
        def run(out: Path, seed: int, say: object, shown: Path, work: object) -> dict[str, str]:
            assert shown == tmp_path / "demo"
            (out / "rig.json").write_text(text)
            if stop:
                raise KeyboardInterrupt
            return {}

        return run

    monkeypatch.setattr(story, "run_demo", runs("old", stop=False))
    assert furuta("demo", "--out", tmp_path / "demo").exit_code == 0
    monkeypatch.setattr(story, "run_demo", runs("new", stop=True))
    result = furuta("demo", "--out", tmp_path / "demo")
    assert result.exit_code == 130
    assert "Nothing was written" in result.stderr
    assert contents(tmp_path / "demo") == {"rig.json": "old"}
