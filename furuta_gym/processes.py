"""Processes that end together: workers with who started them, and temporary folders with who made them."""

from __future__ import annotations

import os
import re
import shutil
import signal
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from .files import stale, temporary_name

_LOOK = 0.5  # s between two looks at the parent


def worker_options() -> dict[str, Any]:
    """Keyword arguments for joblib's loky backend, so that its processes end when this one does, however it ends."""
    return {"initializer": stay_with, "initargs": (os.getpid(),)}


def stay_with(parent: int) -> None:
    """In a worker: end soon after the process `parent`, and leave Ctrl-C to it."""
    if os.getpid() == parent:
        return
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal sends it to all; the parent ends its workers

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_LOOK)
        os._exit(1)

    if hasattr(os, "getppid") and os.name != "nt":  # on Windows the number stays when the parent is gone
        threading.Thread(target=watch, daemon=True, name="parent watch").start()


@contextmanager
def ending_in_order() -> Iterator[None]:
    """Let SIGTERM and SIGHUP end this process as an exception does: workers and temporary folders go with it."""

    def end(number: int, frame: Any) -> None:
        for name in before:
            signal.signal(name, signal.SIG_IGN)  # a second one must not interrupt the clearing up
        raise SystemExit(128 + number)

    names = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    before = {}
    with suppress(ValueError):  # not in the main thread
        for name in names:
            if signal.getsignal(name) == signal.SIG_DFL:  # `nohup` has it ignored, and that stays
                before[name] = signal.signal(name, end)
    try:
        yield
    finally:
        for name, handler in before.items():
            signal.signal(name, handler)


def new_temporary_folder(name: str) -> Path:
    """A folder of random name in the temporary folder, for this user only; those of killed processes are removed."""
    place = Path(tempfile.gettempdir()) / f"furuta-{name}"
    for left in stale(place, r"\w{8}"):
        shutil.rmtree(left, ignore_errors=True)
    prefix = re.sub(r"new$", "", temporary_name(place).name)
    return Path(tempfile.mkdtemp(prefix=prefix, dir=place.parent))


@contextmanager
def temporary_folder(name: str) -> Iterator[Path]:
    """A `new_temporary_folder` that goes at the end."""
    folder = new_temporary_folder(name)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
