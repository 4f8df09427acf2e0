"""Computations off the event loop: one at a time in a tab, told step by step, cancelled between steps."""

from __future__ import annotations

import asyncio
import ctypes
import logging
import os
import sys
import time
from collections.abc import Awaitable, Callable
from concurrent.futures import Executor, Future
from contextlib import suppress
from dataclasses import dataclass, field
from threading import Thread
from typing import Any, ParamSpec, TypeVar
from weakref import WeakSet

_logger = logging.getLogger("furuta.studio")
T = TypeVar("T")
P = ParamSpec("P")
EXPECTED = (ValueError, OSError, FloatingPointError)
LONGEST_END = 3.0  # s that computations have to end with the studio
AFTERWARDS = 2.0  # s from a computation until memory is given back: whoever asked has dropped by then what is not kept
MOST_KEPT = 1 << 20  # bytes of free memory that glibc may keep at the end of what it has for a thread
_library = ctypes.CDLL(None) if sys.platform == "linux" else None
_malloc_trim = getattr(_library, "malloc_trim", None)  # glibc alone has it
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3  # malloc.h


class Cancelled(Exception):
    """The user asked to stop, closed the tab or ended the studio."""


@dataclass
class Job:
    """A long computation as the page shows it and ends it. steps: what it said so far."""

    steps: list[str] = field(default_factory=list)
    running: bool = False
    cancelled: bool = False

    def tell(self, step: str) -> None:
        """Called by the computation at each step. Raises Cancelled once that was asked for."""
        self.check()
        self.steps.append(step)

    def check(self) -> None:
        """Called by the computation between its parts. Raises Cancelled once that was asked for."""
        if self.cancelled:
            raise Cancelled

    def cancel(self) -> None:
        self.cancelled = True

    @property
    def pool(self) -> Executor:
        """Where a fit's filters run: it raises Cancelled in a fit that has no other part in which it could be asked."""
        return _Pool(self)


class _Pool(Executor):
    """The pool of all fits, which takes nothing more from a job that was cancelled."""

    def __init__(self, job: Job) -> None:
        self._job = job

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        from identification.estimation.pool import shared_pool  # slow to import, and the page is shown before

        self._job.check()
        return shared_pool().submit(fn, *args, **kwargs)


def end_soon() -> None:
    """End this process in LONGEST_END at the latest, as code that is compiled or a long fit cannot be interrupted."""

    def end() -> None:
        time.sleep(LONGEST_END)
        os._exit(130)  # as after Ctrl-C

    Thread(target=end, daemon=True).start()


def sentence(error: BaseException) -> str:
    """What an error says to somebody who looks at a page."""
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    if isinstance(error, EXPECTED) and str(error):
        return str(error)
    return (
        f"This computation failed ({type(error).__name__}: {error}). The page goes on; what was there before is kept. "
        "Please report it with the log."
    )


async def off_loop(function: Callable[..., T], *arguments: Any) -> T:
    """Run in a thread; the compiled code lets others run meanwhile. Memory that it no longer needs is given back."""
    try:
        return await asyncio.to_thread(function, *arguments)
    except (*EXPECTED, Cancelled):
        raise
    except Exception:
        _logger.exception("a computation of the studio failed")
        raise
    finally:
        _give_back_soon()


def keep_little() -> None:
    """Have threads give back what they free at the end of their memory, and have large arrays outside of it.

    glibc keeps the memory that a thread has freed for this thread, and the more the larger the arrays were. Threads
    take turns with the computations, so that each would come to hold as much as the largest of them needs."""
    if _library is not None and _malloc_trim is not None:
        _library.mallopt(_M_TRIM_THRESHOLD, MOST_KEPT)
        _library.mallopt(_M_MMAP_THRESHOLD, MOST_KEPT)


_due: WeakSet[asyncio.AbstractEventLoop] = WeakSet()  # loops that will give memory back


def _give_back_soon() -> None:
    """Have what is free between things that are kept given back too, once for all computations of some seconds."""
    loop, trim = asyncio.get_running_loop(), _malloc_trim
    if trim is None or loop in _due:
        return

    def give_back() -> None:
        _due.discard(loop)
        with suppress(RuntimeError):  # the studio ends
            loop.run_in_executor(None, trim, 0)

    _due.add(loop)
    loop.call_later(AFTERWARDS, give_back)


class Latest:
    """Runs an action for the newest request only: while one runs, those between are left out."""

    def __init__(self, action: Callable[[], Awaitable[None]]) -> None:
        self._action = action
        self.wanted, self.busy = False, False

    async def ask(self) -> None:
        """Run the action, or have it run again when the present one ends."""
        self.wanted = True
        if self.busy:
            return
        self.busy = True
        try:
            while self.wanted:
                self.wanted = False
                await self._action()
        finally:
            self.busy = False
