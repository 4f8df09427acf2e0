"""How commands print and write: JSON, and progress on stderr."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

import typer
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from .steps import busy as busy  # beside the other ways to print
from .steps import errors as errors


def print_json(data: Any) -> None:
    """Machine-readable output on stdout; infinities and NaN are refused (ValueError)."""
    typer.echo(json.dumps(data, ensure_ascii=False, indent=2, allow_nan=False))


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


def progress_bar() -> Progress:
    """A bar with counts and time on stderr."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    return Progress(*columns, console=errors, transient=True)
