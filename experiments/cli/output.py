"""How commands print and write: JSON, and progress on stderr."""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import typer
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from .letters import stdout_is_utf8
from .steps import busy as busy  # beside the other ways to print
from .steps import errors as errors
from .steps import short

QUIET = 3.0
"""Seconds between lines of `counted`, at least."""


def print_json(data: Any) -> None:
    """Machine-readable output on stdout; infinities and NaN are refused (ValueError)."""
    typer.echo(json.dumps(data, ensure_ascii=not stdout_is_utf8(), indent=2, allow_nan=False))


def write_json(path: Path, data: Any) -> None:
    """Write a JSON file, whole or not at all."""
    from furuta_gym.files import write_whole

    text = json.dumps(data, ensure_ascii=False, indent=2, allow_nan=False) + "\n"
    write_whole(path, text)


def check_folder(path: Path) -> None:
    """That files can be written into a folder, which need not be there yet. Raises ValueError."""
    if path.exists() and not path.is_dir():
        raise ValueError(f"output {path} is a file; expected the name of a folder")
    there = next(parent for parent in (path, *path.absolute().parents) if parent.exists())
    try:
        tempfile.TemporaryFile(dir=there).close()
    except OSError as error:
        raise ValueError(f"output {path}: nothing can be written in {there} ({error.strerror})") from None


@contextmanager
def counted(what: str) -> Iterator[Callable[..., None]]:
    """Give `tell(done, of, what=...)`, which shows on stderr how much of a long work is done: as a bar on a terminal,
    elsewhere in lines, about ten, and none for what takes a few seconds."""
    if errors.is_terminal:
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
        with Progress(*columns, console=errors, transient=True) as bar:
            row = bar.add_task(what, total=None)
            yield lambda done, of, what=what: bar.update(row, description=what, completed=done, total=of)
        return
    began = last = time.monotonic()
    shown = (what, 0)

    def tell(done: int, of: int, what: str = what) -> None:
        nonlocal last, shown
        now, tenth = time.monotonic(), (what, 10 * done // max(of, 1))
        if tenth != shown and now - last >= QUIET:
            errors.print(f"[{short(now - began)}] {what}: {done} of {of}", markup=False, highlight=False)
            last, shown = now, tenth

    yield tell
