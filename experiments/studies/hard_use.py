"""Kill -9 at random moments, full disks and read-only folders, for every command that writes.

    python -m experiments.studies.hard_use --kills 100 -o out/hard_use

A command's result must be the old one or the new one, whole, every time; nothing may run on, and the same command
must work again afterwards and leave nothing of the others behind. Without the right to mount a small file system, a
full disk is a limit on the size of files (RLIMIT_FSIZE), and the read-only disk is left out.
"""

from __future__ import annotations

import argparse
import io
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import uuid
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from furuta_gym.files import read_json, write_whole

ROOT = Path(__file__).resolve().parents[2]
_MARK = "FURUTA_HARD_USE"
_GONE = 20.0  # s until what a killed process started must be gone
_FREE = (0, 4096, 65536)  # bytes that are left on the disk


@dataclass(frozen=True)
class Case:
    """A command: its arguments with `{in}` and `{out}` for folders, and what it writes in `{out}`.

    together: they are of one run, all of them. again: further arguments with which a stopped run goes on, and the
    pattern of the files that it goes on from. last: what is there when a run has ended whose result is not made anew,
    so that the next one starts from nothing.
    """

    arguments: str
    writes: tuple[str, ...]
    together: bool = True
    again: tuple[str, str] | None = None
    last: str | None = None


CASES = {
    "simulate": Case("simulate --plant qube --controller lqr --duration 2 -o {out}/log.csv", ("log.csv",)),
    "simulate-npz": Case("simulate --plant qube --controller lqr --duration 2 -o {out}/log.npz", ("log.npz",)),
    "bench": Case(
        "bench record --rig rig-01 --duration 2 --reveal -o {out}/b.csv", ("b.csv", "b.truth.json"), together=False
    ),
    "seal": Case("bench seal --groups 1 --kinds none --key-file {in}/key --seed 1 -o {out}/s", ("s",), last="s"),
    "init": Case("init {in}/log.csv --yes -o {out}/rig.toml", ("rig.toml",)),
    "identify": Case("identify {in}/log.csv -o {out}/rig.json", ("rig.json",)),
    "identify-page": Case(
        "identify {in}/log.csv -o {out}/rig.json --plot {out}/fit.png --report {out}/page.html",
        ("rig.json", "fit.png", "page.html"),
        together=False,
    ),
    "validate": Case(
        "validate table3 {in}/log.csv --plots {out}/plots --json {out}/gap.json --report {out}/page.html",
        ("plots", "gap.json", "page.html"),
        together=False,
    ),
    "residuals": Case("residuals {in}/log.csv --plant table3 -o {out}/r", ("r",)),
    "excite": Case("excite --plant qube --duration 2 -o {out}/u.csv", ("u.csv",)),
    "export-c": Case("export qube --controller lqr -o {out}/lqr.h", ("lqr.h",)),
    "export-onnx": Case("export qube {in}/policy.zip -o {out}/p.onnx", ("p.onnx",)),
    "export-mjcf": Case("export qube -o {out}/qube.xml", ("qube.xml",)),
    "compare": Case("compare --plant qube --trials 4 --duration 0.5 --groups balance,push -o {out}/c", ("c",)),
    "train": Case(
        "train --plant qube --algo ppo --steps 20000 -o {out}/policy.zip",
        ("policy.zip", "policy.json"),
        together=False,
        again=("--resume", "policy.checkpoint/[0-9]*"),
        last="policy.json",
    ),
    "trials": Case(
        "trials --seeds 1 --kinds none --rigs table3 --jobs 2 -o {out}/t", ("t",), False, last="t/summary.json"
    ),
    "diagnose": Case("diagnose {in}/log.csv --held-out {in}/other.csv --max-effects 1 -o {out}/d", ("d",)),
    "demo": Case("demo --out {out}/demo", ("demo",)),
}


@dataclass
class Outcome:
    """What came of a command: counts by what was found, and sentences on what should not be."""

    counts: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)

    def to_dict(self) -> dict[str, Any]:
        return {"counts": dict(self.counts), "faults": self.faults}


class Laboratory:
    """Folders of one study: inputs, outputs, a temporary folder of its own, and the environment of the commands."""

    def __init__(self, room: Path) -> None:
        self.room, self.inputs, self.outputs, self.temporary = room, room / "in", room / "out", room / "tmp"
        for folder in (self.inputs, self.outputs, self.temporary):
            folder.mkdir(parents=True)
        self.mark = uuid.uuid4().hex
        path = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
        self.environment = os.environ | {"TMPDIR": str(self.temporary), _MARK: self.mark, "PYTHONPATH": path}
        from controllers.policies import FOLDER
        from experiments.demo.story import FITTED, HELD_OUT
        from identification.logs.log import read_log, write_log

        for source, name in ((FITTED, "log.csv"), (HELD_OUT, "other.csv")):
            write_log(self.inputs / name, read_log(source).slice(stop=4.0))
        shutil.copy(FOLDER / "balance-qube.zip", self.inputs / "policy.zip")
        (self.inputs / "key").write_text("a key for nothing but this study\n")

    def start(self, case: Case, more: str = "", size: int | None = None) -> subprocess.Popen[bytes]:
        """The command in a session of its own; size: the largest file [bytes] that it may write."""
        words = f"{case.arguments} {more}".split()
        words = [w.replace("{in}", str(self.inputs)).replace("{out}", str(self.outputs)) for w in words]
        limit = [] if size is None else [f"import resource; resource.setrlimit(resource.RLIMIT_FSIZE, ({size},) * 2)"]
        code = "; ".join([*limit, "from furuta_command import main", "main()"])
        return subprocess.Popen(
            [sys.executable, "-c", code, *words],
            env=self.environment,
            cwd=self.room,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            start_new_session=True,
        )

    def finish(self, case: Case, more: str = "", size: int | None = None) -> tuple[int, str]:
        """Exit code and what was said on stderr."""
        process = self.start(case, more, size)
        said = process.communicate()[1].decode(errors="replace")
        return process.returncode, said

    def running(self) -> list[int]:
        """Processes that the commands started and that still run."""
        found = []
        for entry in Path("/proc").iterdir() if Path("/proc").is_dir() else ():
            with suppress(OSError):
                if entry.name.isdecimal() and f"{_MARK}={self.mark}".encode() in (entry / "environ").read_bytes():
                    state = (entry / "stat").read_text().rpartition(")")[2].split()[0]
                    found += [int(entry.name)] if state != "Z" else []
        return found

    def state(self, case: Case) -> dict[str, tuple[bytes, float]]:
        """Content and time of every file that the command writes."""
        found = {}
        for name in case.writes:
            place = self.outputs / name
            for file in sorted(place.rglob("*")) if place.is_dir() else [place]:
                if file.is_file():
                    found[str(file.relative_to(self.outputs))] = file.read_bytes(), file.stat().st_mtime
        return found

    def strays(self) -> list[str]:
        """Hidden files beside the results, what only a stopped run needs, and anything in the temporary folder."""
        left = [p for pattern in (".*", "*.search.jsonl", "*.checkpoint") for p in self.outputs.rglob(pattern)]
        hidden = [str(p.relative_to(self.outputs)) for p in left if not p.name.endswith(".lock")]
        return hidden + [p.name for p in self.temporary.iterdir() if p.name.startswith("furuta")]


def whole(name: str, data: bytes) -> bool:
    """Whether a file is complete, as far as its format tells."""
    ending = Path(name).suffix
    try:
        if ending == ".json":
            read_json(data)
        elif ending == ".jsonl":
            return all(isinstance(json.loads(line), dict) for line in data.splitlines()[:-1])
        elif ending in (".zip", ".npz"):
            return zipfile.ZipFile(io.BytesIO(data)).testzip() is None
        elif ending == ".png":
            return data.startswith(b"\x89PNG") and data.endswith(b"IEND\xaeB`\x82")
        elif ending == ".csv":
            rows = [line for line in data.decode().splitlines() if not line.startswith("#")]
            return data.endswith(b"\n") and len({row.count(",") for row in rows}) == 1
        elif ending in (".html", ".xml"):
            return data.rstrip().endswith((b"</html>", b"</mujoco>"))
        elif ending == ".h":
            return data.rstrip().endswith((b"#endif", b"*/", b"}"))
    except (ValueError, OSError, zipfile.BadZipFile):
        return False
    return True


def kill_at_random(lab: Laboratory, name: str, case: Case, kills: int, draw: random.Random) -> Outcome:
    """Kill the command `kills` times at work, then let it end. Runs that end before their kill count as "ended"."""
    outcome = Outcome()
    for _ in range(2):  # the first one may compile
        began = time.monotonic()
        _prepare(lab, case)
        code, said = lab.finish(case)
        usual = time.monotonic() - began
        if code != 0:
            outcome.faults.append(f"it fails undisturbed: {said[-300:]}")
            return outcome
    killed = 0
    while killed < kills and outcome.counts["ended"] <= 3 * kills:
        more = _prepare(lab, case)
        old, started, began = lab.state(case), time.time(), time.monotonic()
        process = lab.start(case, more)
        with suppress(subprocess.TimeoutExpired):
            process.wait(draw.uniform(0.1, 1.05) * usual)
        if process.poll() is None:
            process.send_signal(signal.SIGKILL)
        said = process.communicate()[1].decode(errors="replace")
        if process.returncode == -signal.SIGKILL:
            killed += 1
            outcome.counts[_found(lab, case, old, started, outcome)] += 1
        else:
            outcome.counts["ended"] += 1
            if not more:
                usual = min(usual, time.monotonic() - began)
            if process.returncode != 0:
                outcome.faults.append(f"after {killed} kills, exit code {process.returncode}: {said[-300:]}")
        late = time.monotonic() + _GONE
        while (left := lab.running()) and time.monotonic() < late:
            time.sleep(0.1)
        if left:
            outcome.faults.append(f"processes run on: {left}")
            for number in left:
                with suppress(OSError):
                    os.kill(number, signal.SIGKILL)
    code, said = lab.finish(case, _prepare(lab, case))
    if code != 0:
        outcome.faults.append(f"after the kills it fails: {said[-300:]}")
    if strays := lab.strays():
        outcome.faults.append(f"left behind: {strays[:5]}")
    if bad := [file for file, (data, _) in lab.state(case).items() if not whole(file, data)]:
        outcome.faults.append(f"not whole at the end: {bad}")
    return outcome


def _prepare(lab: Laboratory, case: Case) -> str:
    """Make room for a run whose result is not made anew; further arguments where there is something to go on from."""
    if case.last is not None and (lab.outputs / case.last).exists():
        _empty(lab)
    return case.again[0] if case.again and any(lab.outputs.glob(case.again[1])) else ""


def _found(lab: Laboratory, case: Case, old: dict[str, tuple[bytes, float]], started: float, outcome: Outcome) -> str:
    """ "old", "new" or "broken" of a command's files, for the count; what is broken becomes a fault."""
    now = lab.state(case)
    if now == old:
        return "old"
    if bad := [file for file, (data, _) in now.items() if not whole(file, data)]:
        outcome.faults.append(f"not whole: {bad}")
        return "broken"
    if case.together and (mixed := [file for file, (_, at) in now.items() if at < started - 0.01]):
        outcome.faults.append(f"of an older run beside new ones: {mixed}")
        return "broken"
    return "new"


@contextmanager
def small_disk(place: Path, size: int) -> Iterator[bool]:
    """A file system of `size` bytes at `place`; False where none can be mounted."""
    mounted = (
        hasattr(os, "geteuid")
        and os.geteuid() == 0
        and subprocess.run(
            ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", place], capture_output=True
        ).returncode
        == 0
    )
    try:
        yield mounted
    finally:
        if mounted:
            subprocess.run(["umount", "-l", place], check=False)


def full_disk(lab: Laboratory, name: str, case: Case) -> Outcome:
    """Run the command with hardly any room, over an old result and without one."""
    outcome = Outcome()
    with small_disk(lab.outputs, 64 << 20) as mounted:
        code, said = lab.finish(case)
        if code != 0:
            outcome.faults.append(f"it fails with room: {said[-300:]}")
            return outcome
        _prepare(lab, case)
        old = lab.state(case)
        for free in _FREE:
            ballast = lab.outputs / "ballast"
            if mounted:
                _fill(ballast, free)
            code, said = lab.finish(case, size=None if mounted else free)
            ballast.unlink(missing_ok=True)
            _judge(lab, case, old, code, said, f"{free} bytes free", outcome)
            if case.last is not None:
                _empty(lab)
            old = lab.state(case)
        if mounted:
            subprocess.run(["mount", "-o", "remount,ro", lab.outputs], check=True)
            code, said = lab.finish(case)
            subprocess.run(["mount", "-o", "remount,rw", lab.outputs], check=True)
            _judge(lab, case, old, code, said, "read-only", outcome, must_fail=True)
        code, said = lab.finish(case, _prepare(lab, case))
        if code != 0:
            outcome.faults.append(f"with room again it fails: {said[-300:]}")
        if strays := lab.strays():
            outcome.faults.append(f"left behind: {strays[:5]}")
    return outcome


def _judge(
    lab: Laboratory,
    case: Case,
    old: dict[str, tuple[bytes, float]],
    code: int,
    said: str,
    where: str,
    outcome: Outcome,
    must_fail: bool = False,
) -> None:
    now = lab.state(case)
    outcome.counts[f"{where}: exit code {code}"] += 1
    if code not in ((2,) if must_fail else (0, 2)) or "Traceback" in said:
        outcome.faults.append(f"{where}: exit code {code}: {said[-300:]}")
    if code == 2 and str(lab.outputs) not in said:
        outcome.faults.append(f"{where}: names no file of the user's: {said[-200:]}")
    if code == 2 and case.together and now != old:
        outcome.faults.append(f"{where}: the old result changed")
    if bad := [file for file, (data, _) in now.items() if not whole(file, data)]:
        outcome.faults.append(f"{where}: not whole: {bad}")


def _fill(ballast: Path, free: int) -> None:
    """A file that leaves so many bytes on its file system."""
    at = os.statvfs(ballast.parent)
    size = at.f_bavail * at.f_frsize - free
    with open(ballast, "wb") as file, suppress(OSError):
        while size > 0:
            size -= file.write(b"\0" * min(size, 1 << 20))
            file.flush()


def _empty(lab: Laboratory) -> None:
    for file in lab.outputs.iterdir():
        shutil.rmtree(file, ignore_errors=True) if file.is_dir() else file.unlink()


def study(
    names: Sequence[str], kills: int, disks: bool, seed: int, say: Callable[[str], None] = print
) -> dict[str, dict[str, Any]]:
    """What came of each command: {name: {"kills": …, "disk": …}}."""
    found: dict[str, dict[str, Any]] = {}
    for number, name in enumerate(names):
        draw = random.Random(f"{seed} {number}")
        results = found[name] = {}
        runs: list[tuple[str, Callable[[Laboratory], Outcome]]] = []
        if kills:
            runs.append(("kills", lambda lab, n=name, d=draw: kill_at_random(lab, n, CASES[n], kills, d)))
        if disks:
            runs.append(("disk", lambda lab, n=name: full_disk(lab, n, CASES[n])))
        for kind, run in runs:
            with tempfile.TemporaryDirectory(prefix="hard-use-") as room:
                outcome = run(Laboratory(Path(room) / "room"))
            results[kind] = outcome.to_dict()
            counts = ", ".join(f"{n} {what}" for what, n in sorted(outcome.counts.items()))
            say(f"{name}, {kind}: {counts or 'nothing run'}; {len(outcome.faults)} faults")
            for fault in outcome.faults[:5]:
                say(f"    {fault}")
    return found


def main() -> int:
    """Exit code 1 where something happened that may not."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("commands", nargs="*", choices=[[], *CASES], help="default: all")
    parser.add_argument("--kills", type=int, default=100, help="kills of each command")
    parser.add_argument("--no-disks", action="store_true", help="leave the full and read-only disks out")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("-o", "--output", type=Path, default=Path("out/hard_use"))
    options = parser.parse_args()
    names = options.commands or list(CASES)
    found = study(names, options.kills, not options.no_disks, options.seed, lambda line: print(line, flush=True))
    write_whole(options.output / "results.json", json.dumps(found, ensure_ascii=False, indent=2) + "\n")
    return int(any(part["faults"] for parts in found.values() for part in parts.values()))


if __name__ == "__main__":
    sys.exit(main())
