"""Kill -9 at random moments: the old result or the new one, whole, and the same command works again."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import time
from contextlib import suppress

from .cases import Case
from .laboratory import Laboratory, Outcome, whole

_GONE = 20.0  # s until what a killed process started must be gone


def kill_at_random(lab: Laboratory, name: str, case: Case, kills: int, draw: random.Random) -> Outcome:
    """Kill the command `kills` times at work, then let it end. Runs that end before their kill count as "ended"."""
    outcome = Outcome()
    usual = 0.0
    for _ in range(2):  # the first one may compile
        began = time.monotonic()
        lab.prepare(case)
        code, said = lab.finish(case)
        usual = time.monotonic() - began
        if code != 0:
            outcome.faults.append(f"it fails undisturbed: {said[-300:]}")
            return outcome
    killed = 0
    while killed < kills and outcome.counts["ended"] <= 3 * kills:
        more = lab.prepare(case)
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
    code, said = lab.finish(case, lab.prepare(case))
    if code != 0:
        outcome.faults.append(f"after the kills it fails: {said[-300:]}")
    if strays := lab.strays():
        outcome.faults.append(f"left behind: {strays[:5]}")
    if bad := [file for file, (data, _) in lab.state(case).items() if not whole(file, data)]:
        outcome.faults.append(f"not whole at the end: {bad}")
    return outcome


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
