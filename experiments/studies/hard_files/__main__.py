"""Read many damaged files and count what comes of it: sentences, and what may not happen.

    python -m experiments.studies.hard_files --logs 200000 --plants 100000 --policies 10000

The files are read in a child process. A case that ends it, or takes longer than a minute, is counted, kept in --keep,
and the next child goes on behind it. Every case follows from --seed and its number.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import select
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections import Counter
from pathlib import Path
from typing import Any

LONGEST = 60.0
"""Seconds for one file."""
MEMORY = 12 << 30
"""Bytes of address space for the process that reads."""
KINDS = ("logs", "mat", "bags", "plants", "policies")
_CANARY = "it-ran"
_CALLS = ("pickle.find_class", "os.system", "os.exec", "os.posix_spawn", "subprocess.Popen", "socket.connect")


class Hang(BaseException):
    """A case that took longer than `LONGEST`."""


def case_of(kind: str, seed: int, number: int) -> tuple[str, bytes, dict[str, Any]]:
    """Ending, content and options of a case."""
    from . import bags, logs, others

    draw = random.Random(f"{seed} {kind} {number}")
    if kind == "bags":
        return *bags.bag_case(draw), {}
    if kind in ("logs", "mat"):
        case = logs.log_case(draw, (".mat",)) if kind == "mat" else logs.log_case(draw)
        return case.ending, case.raw, case.options
    return (".json", others.plant_case(draw), {}) if kind == "plants" else (".zip", others.policy_case(draw), {})


def try_case(kind: str, ending: str, raw: bytes, options: dict[str, Any], folder: Path) -> str:
    """What comes of a case: "read" or "refused"; a fault is raised."""
    from . import bags, logs, others

    if kind == "bags":
        return bags.try_bag(ending, raw, folder)
    if kind in ("logs", "mat"):
        return logs.try_log(logs.LogCase(ending, raw, options), folder)
    return others.try_plant(raw, folder) if kind == "plants" else others.try_policy(raw, folder)


def read_cases(kind: str, seed: int, first: int, last: int) -> None:
    """In the child, whose working folder is its own: a line of JSON for every case."""
    _bound()
    for warm in range(20):  # what is imported when it is needed is imported before calls are looked for
        try_case(kind, *case_of(kind, -1, warm), Path())
    called: list[str] = []

    def hear(event: str, arguments: tuple[Any, ...]) -> None:
        if event in _CALLS and "apart_child.py" not in str(arguments):
            called.append(f"{event} {arguments!r}"[:300])

    sys.addaudithook(hear)

    def late(*_: object) -> None:
        raise Hang(f"more than {LONGEST:g} s")

    signal.signal(signal.SIGALRM, late)
    for number in range(first, last):
        case = case_of(kind, seed, number)
        signal.setitimer(signal.ITIMER_REAL, LONGEST)
        fault = ""
        try:
            outcome = try_case(kind, *case, Path())
        except Hang as error:
            outcome, fault = "hang", str(error)
        except Exception:
            outcome, fault = "traceback", traceback.format_exc(limit=-6)
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        if called or Path(_CANARY).exists():
            outcome, fault = "code run", "; ".join(called) or _CANARY
            called.clear()
            Path(_CANARY).unlink(missing_ok=True)
        print(json.dumps([number, outcome, fault]), flush=True)


def _bound() -> None:
    import resource

    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def run(kind: str, count: int, seed: int, keep: Path, first: int = 0) -> Counter[str]:
    """Outcomes of `count` cases of a kind, read in child processes."""
    counts: Counter[str] = Counter()
    number, end, started = first, first + count, time.monotonic()
    while number < end:
        with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryFile() as errors:
            command = [sys.executable, "-m", str(__package__), "--child", kind, str(seed), str(number), str(end)]
            path = os.pathsep.join([str(Path(__file__).parents[3]), *filter(None, [os.environ.get("PYTHONPATH")])])
            child = subprocess.Popen(
                command,
                cwd=folder,
                stdout=subprocess.PIPE,
                stderr=errors,
                env=os.environ | {"PYTHONPATH": path},
            )
            assert child.stdout is not None
            patience = 10 * LONGEST  # it compiles at first
            while select.select([child.stdout], [], [], patience)[0] and (line := child.stdout.readline()):
                number, outcome, fault = json.loads(line)
                patience = 2 * LONGEST
                counts[outcome] += 1
                if fault:
                    _keep(keep, kind, seed, number, outcome, fault)
                number += 1
                if (number - first) % 2000 == 0:
                    spent = time.monotonic() - started
                    print(f"{kind}: {number - first} of {count} in {spent:.0f} s, {dict(counts)}", file=sys.stderr)
            child.kill()
            code = child.wait()
            errors.seek(0)
            said = errors.read().decode(errors="replace")
        if number < end:
            if not counts:
                raise RuntimeError(f"no case was read: {said[-2000:]}")
            counts["process death"] += 1
            _keep(keep, kind, seed, number, "process death", f"exit code {code} {said[-1000:]}")
            number += 1
    return counts


def _keep(folder: Path, kind: str, seed: int, number: int, outcome: str, fault: str) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    ending, raw, options = case_of(kind, seed, number)
    (folder / f"{kind}-{seed}-{number}{ending}").write_bytes(raw)
    (folder / f"{kind}-{seed}-{number}.txt").write_text(f"{outcome}\n{options}\n{fault}\n", encoding="utf-8")
    print(
        f"{kind} {number}: {outcome}: {fault.strip().splitlines()[-1][:200] if fault.strip() else ''}", file=sys.stderr
    )


def main() -> int:
    """Exit code 1 where something happened that may not."""
    if sys.argv[1:2] == ["--child"]:
        kind, *numbers = sys.argv[2:]
        seed, first, last = map(int, numbers)
        read_cases(kind, seed, first, last)
        return 0
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for kind in KINDS:
        parser.add_argument(f"--{kind}", type=int, default=0, metavar="N", help=f"how many ({kind})")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--keep", type=Path, default=Path("out/hard_files"), help="folder for the cases with a fault")
    options = parser.parse_args()
    bad = 0
    for kind in KINDS:
        if count := getattr(options, kind):
            started = time.monotonic()
            counts = run(kind, count, options.seed, options.keep, options.first)
            bad += sum(n for outcome, n in counts.items() if outcome not in ("read", "refused"))
            said = ", ".join(f"{n} {outcome}" for outcome, n in sorted(counts.items()))
            print(f"{kind}: {sum(counts.values())} in {time.monotonic() - started:.0f} s: {said}", flush=True)
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
