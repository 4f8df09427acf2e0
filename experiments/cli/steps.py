"""Long work, step by step: on a terminal a line that shows the step and the time, elsewhere a line for each step."""

from __future__ import annotations

import json
import logging
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from rich.console import Console
from rich.live import Live
from rich.spinner import Spinner
from rich.text import Text

_logger = logging.getLogger("furuta.steps")

errors = Console(stderr=True)
"""Where progress and remarks go, so that results can be piped."""

FIRST_TIME: dict[str, tuple[float, float]] = {
    "identify": (2.0, 0.5),
    "validate": (2.0, 0.3),
    "diagnose": (10.0, 2.0),
    "residuals": (5.0, 0.7),
}
"""Seconds, and seconds for a thousand samples, as two idle cores took; runs here say how this machine compares."""

LONGER = {"diagnose": "; where several effects are missing, three to ten times as long (--minutes limits it)"}
"""By command, when it takes much longer than it usually does."""

_SLOWEST = 50.0


@contextmanager
def steps(
    command: str, samples: int | None = None, console: Console | None = None, began: float | None = None
) -> Iterator[Callable[[str], None]]:
    """Give a function that is told each step of a long work as it begins.

    command: of `furuta`, of `FIRST_TIME` where samples are given; how fast it went here is remembered by it. began:
    `time.monotonic()` at the start, where other work went before.
    """
    from furuta_gym.cache_folder import compilations  # not before a long work: help loads no library of numbers

    console = console or errors
    began, compiled = time.monotonic() if began is None else began, compilations()
    expected = None if samples is None else _expected(command, samples)
    line = _Line(began, expected)
    live = Live(line, console=console, transient=True, refresh_per_second=4) if console.is_terminal else None

    def tell(text: str) -> None:
        line.text = text
        _logger.info("%s: %s", command, text)
        if live is None:
            console.print(f"[{short(time.monotonic() - began)}] {text}", markup=False, highlight=False, soft_wrap=True)

    if live is None and expected is not None and expected >= 20:
        console.print(
            f"furuta {command}: about {short(expected)}{LONGER.get(command, '')}",
            markup=False,
            highlight=False,
            soft_wrap=True,
        )
    if live is not None:
        with live:
            yield tell
    else:
        yield tell
    if samples is not None and compilations() == compiled:  # else the next run will be faster
        _remember(command, samples, time.monotonic() - began)


class _Line:
    """What the terminal shows: a spinner, the step, the time that has passed and the time to expect."""

    def __init__(self, began: float, expected: float | None):
        self.began, self.expected, self.text = began, expected, ""
        self.spinner = Spinner("dots")

    def __rich__(self) -> Spinner:
        passed = short(time.monotonic() - self.began)
        whole = ""
        if self.expected is not None:
            late = time.monotonic() - self.began > self.expected
            whole = f"{', longer than the usual' if late else ' of about'} {short(self.expected)}"
        self.spinner.update(text=Text(f"{self.text} …  {passed}{whole}"))
        return self.spinner


def short(seconds: float) -> str:
    """As people say it: 8 s, 2 min 10 s, 1 h 5 min."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    minutes, rest = divmod(whole, 60)
    if minutes < 60:
        return f"{minutes} min {rest} s" if minutes < 10 and rest else f"{minutes} min"
    return f"{minutes // 60} h {minutes % 60} min"


def _notebook() -> Path | None:
    from furuta_gym.cache_folder import cache_root

    root = cache_root()
    return None if root is None else root / "pace.json"


def _remembered() -> dict[str, float]:
    """By command, how many times as long as `FIRST_TIME` says the last runs here took."""
    with suppress(OSError, ValueError):
        notebook = _notebook()
        if notebook is not None:
            found = json.loads(notebook.read_text(encoding="utf-8"))
            found = found if isinstance(found, dict) else {}
            return {k: float(v) for k, v in found.items() if isinstance(v, int | float) and 0 < v < _SLOWEST}
    return {}


def _usual(command: str, samples: int) -> float:
    fixed, each = FIRST_TIME[command]
    return fixed + each * samples / 1000


def _expected(command: str, samples: int) -> float:
    return _remembered().get(command, 1.0) * _usual(command, samples)


def _remember(command: str, samples: int, seconds: float) -> None:
    from furuta_gym.files import write_whole

    notebook = _notebook()
    if notebook is None or samples <= 0:
        return
    before, now = _remembered(), min(seconds / _usual(command, samples), 0.9 * _SLOWEST)
    pace = (before[command] * now) ** 0.5 if command in before else now  # one hard log is not all logs
    with suppress(OSError):
        write_whole(notebook, json.dumps(before | {command: pace}))


@contextmanager
def busy(text: str, command: str = "", samples: int | None = None) -> Iterator[None]:
    """A long work of one step, see `steps`; with the time to expect where samples are given."""
    with steps(command, samples) as tell:
        tell(text.removesuffix(" …"))
        yield
