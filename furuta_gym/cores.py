"""How many cores this process may use."""

import math
import os
import sys
from pathlib import Path

_QUOTA = Path("/sys/fs/cgroup/cpu.max")  # of control groups of version 2


def cores() -> int:
    """Those that the system gives this process; of a container, no more than its quota of time is worth."""
    # not every system tells a process its own cores
    here = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return max(1, min(here, _quota()))


def _quota() -> int:
    """Cores' worth of time that a container gives (`docker run --cpus`); many where none is said."""
    try:
        share, period = _QUOTA.read_text(encoding="ascii").split()
        return sys.maxsize if share == "max" else math.ceil(int(share) / int(period))
    except (OSError, ValueError, ZeroDivisionError):
        return sys.maxsize
