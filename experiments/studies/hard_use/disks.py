"""Disks with hardly any room, and one that can only be read: the old result stands, and a sentence names the file."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from .cases import Case
from .laboratory import Laboratory, Outcome, whole

FREE = (0, 4096, 65536)  # bytes that are left on the disk


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
        lab.prepare(case)
        old = lab.state(case)
        for free in FREE:
            ballast = lab.outputs / "ballast"
            if mounted:
                _fill(ballast, free)
            code, said = lab.finish(case, size=None if mounted else free)
            ballast.unlink(missing_ok=True)
            _judge(lab, case, old, code, said, f"{free} bytes free", outcome)
            if case.last is not None:
                lab.empty()
            old = lab.state(case)
        if mounted:
            subprocess.run(["mount", "-o", "remount,ro", lab.outputs], check=True)
            code, said = lab.finish(case)
            subprocess.run(["mount", "-o", "remount,rw", lab.outputs], check=True)
            _judge(lab, case, old, code, said, "read-only", outcome, must_fail=True)
        code, said = lab.finish(case, lab.prepare(case))
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
