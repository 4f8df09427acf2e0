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
    "identify": (10.0, 5.0),
    "validate": (5.0, 3.0),
    "diagnose": (40.0, 40.0),
    "residuals": (15.0, 10.0),
}
"""Seconds, and seconds for a thousand samples, of a command that has never run here; as measured on two cores."""


@contextmanager
def steps(command: str, samples: int | None = None, console: Console | None = None) -> Iterator[Callable[[str], None]]:
    """Give a function that is told each step of a long work as it begins.

    command: of `furuta`, which its expected time is remembered by, in proportion to the samples of its logs.
    """
    console = console or errors
    began = time.monotonic()
    expected = None if samples is None else _expected(command, samples)
    line = _Line(began, expected)
    live = Live(line, console=console, transient=True, refresh_per_second=4) if console.is_terminal else None

    def tell(text: str) -> None:
        line.text = text
        _logger.info("%s: %s", command, text)
        if live is None:
            console.print(f"[{short(time.monotonic() - began)}] {text}", markup=False, highlight=False, soft_wrap=True)

    if live is None and expected is not None and expected >= 20:
        console.print(f"furuta {command}: about {short(expected)}", markup=False, highlight=False)
    if live is not None:
        with live:
            yield tell
    else:
        yield tell
    if samples is not None:
        _remember(command, samples, time.monotonic() - began)


class _Line:
    """What the terminal shows: a spinner, the step, the time that has passed and the time to expect."""

    def __init__(self, began: float, expected: float | None):
        self.began, self.expected, self.text = began, expected, ""
        self.spinner = Spinner("dots")

    def __rich__(self) -> Spinner:
        passed = short(time.monotonic() - self.began)
        whole = f" of about {short(self.expected)}" if self.expected is not None else ""
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
    return None if root is None else root / "times.json"


def _remembered() -> dict[str, float]:
    """Seconds a sample by command, as the last run here took."""
    with suppress(OSError, ValueError):
        notebook = _notebook()
        if notebook is not None:
            found = json.loads(notebook.read_text(encoding="utf-8"))
            found = found if isinstance(found, dict) else {}
            return {k: float(v) for k, v in found.items() if isinstance(v, int | float) and 0 < v < 1e4}
    return {}


def _expected(command: str, samples: int) -> float | None:
    rate = _remembered().get(command)
    if rate is not None:
        return rate * samples
    if command not in FIRST_TIME:
        return None
    fixed, each = FIRST_TIME[command]
    return fixed + each * samples / 1000


def _remember(command: str, samples: int, seconds: float) -> None:
    from furuta_gym.files import write_whole

    notebook = _notebook()
    if notebook is None or samples <= 0:
        return
    with suppress(OSError):
        write_whole(notebook, json.dumps(_remembered() | {command: seconds / samples}))


@contextmanager
def busy(text: str, command: str = "", samples: int | None = None) -> Iterator[None]:
    """A long work of one step, see `steps`; with the time to expect where samples are given."""
    with steps(command, samples) as tell:
        tell(text.removesuffix(" …"))
        yield
