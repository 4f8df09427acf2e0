"""From a stranger's log to a verdict, by the clock: types what the messages say to type.

    python -m experiments.studies.first_hour LOG HELD_OUT_LOG --folder out/first_hour

Copies the logs into an empty folder, starts with `furuta --help` and `furuta init LOG`, and then knows nothing: each
command is the `Next:` line of the one before it, where LOG stands for the log that was not used yet. Time is the
machine's plus that of a person who reads every word that is printed, at 200 words a minute.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

WORDS_A_MINUTE = 200.0
_ROOT = Path(__file__).resolve().parents[2]
_LINE = re.compile(r"^Next: (furuta .*?)(?:   .*)?$", re.MULTILINE)


@dataclass(frozen=True)
class Step:
    """A command as it was typed, its exit code, its run time [s], and the words that it printed."""

    command: str
    code: int
    seconds: float
    words: int
    said: str

    @property
    def reading(self) -> float:
        """Time to read what it printed [s]."""
        return 60.0 * self.words / WORDS_A_MINUTE


def typed(command: str, folder: Path) -> Step:
    """Run a command line that starts with `furuta` in a folder, without a terminal."""
    words = shlex.split(command)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(_ROOT), os.environ.get("PYTHONPATH", "")])}
    began = time.monotonic()
    done = subprocess.run(
        [sys.executable, "-m", "furuta_command", *words[1:]],
        cwd=folder,
        env=environment,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        encoding="utf-8",
    )
    said = done.stdout + done.stderr
    return Step(command, done.returncode, time.monotonic() - began, len(re.findall(r"\w+", said)), said)


def following(step: Step, spare: Sequence[str]) -> str | None:
    """What a step says to type next, with the logs that were not used yet for LOG; None where it says nothing."""
    found = _LINE.findall(step.said)
    if not found:
        return None
    said = found[-1] if spare else found[-1].replace(" --held-out LOG", "")
    return re.sub(r"\bLOG\b", " ".join(map(shlex.quote, spare)), said)


def walk(logs: Sequence[Path], folder: Path, last: str = "export") -> list[Step]:
    """Type from `--help` on, until nothing more is said to type, a command fails, or `last` has been run."""
    folder.mkdir(parents=True, exist_ok=True)
    for log in logs:
        shutil.copy(log, folder / log.name)
    first, *spare = [log.name for log in logs]
    steps = [typed("furuta --help", folder), typed("furuta init --help", folder)]
    command: str | None = f"furuta init {shlex.quote(first)}"
    while command is not None:
        steps.append(typed(command, folder))
        if steps[-1].code or command.split()[1] == last or len(steps) > 12:
            break
        command = following(steps[-1], spare)
    return steps


def main() -> int:
    """Entry point; exit code 1 where a command failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("logs", nargs="+", type=Path)
    parser.add_argument("--folder", type=Path, default=Path("out/first_hour"))
    parser.add_argument("--last", default="export", help="the command after which to stop")
    options = parser.parse_args()
    shutil.rmtree(options.folder, ignore_errors=True)
    total = 0.0
    verdict = None
    for step in walk([log.resolve() for log in options.logs], options.folder, options.last):
        total += step.seconds + step.reading
        print(f"{step.seconds:6.1f} s + {step.reading:5.1f} s to read  {step.command}")
        if step.code:
            print(step.said)
            return 1
        if verdict is None and step.command.split()[1] == "diagnose":
            verdict = total
    answer = options.folder / "diagnosis" / "diagnosis.json"
    if answer.exists() and verdict is not None:
        found = json.loads(answer.read_text(encoding="utf-8"))
        names = ", ".join(effect["name"] for effect in found["effects"]) or "no effect"
        print(f"verdict after {verdict / 60:.1f} min: {found['verdict']}, {names}")
    print(f"in all {total / 60:.1f} min")
    return 0


if __name__ == "__main__":
    sys.exit(main())
