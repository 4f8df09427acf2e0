"""Computations off the event loop: one at a time in a tab, told step by step, cancelled between steps."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from typing import Any, TypeVar

_logger = logging.getLogger("furuta.studio")
T = TypeVar("T")
EXPECTED = (ValueError, OSError, FloatingPointError)


class Cancelled(Exception):
    """The user asked to stop."""


@dataclass
class Job:
    """A long computation as the page shows it. steps: what it said so far."""

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
    """Run in a thread; the compiled code lets others run meanwhile."""
    try:
        return await asyncio.to_thread(function, *arguments)
    except (*EXPECTED, Cancelled):
        raise
    except Exception:
        _logger.exception("a computation of the studio failed")
        raise


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
