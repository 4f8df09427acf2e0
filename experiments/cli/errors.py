"""Errors as sentences: what went wrong on stderr, exit code 2, no traceback; warnings as readable lines."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import typer

from .letters import without_controls

EXPECTED = (ValueError, OSError, FloatingPointError)
"""What bad input raises here (LogError, DesignError and JSON errors are ValueErrors). Anything else is a bug."""


logging.getLogger("furuta").addHandler(logging.NullHandler())  # else logging itself prints each warning again


@contextmanager
def explained(traceback: bool = False) -> Iterator[None]:
    """Turn expected errors into a message on stderr and exit code 2, and warnings into lines on stderr.

    traceback: let errors through as they are.
    """
    shown: set[str] = set()

    def show(message: Warning | str, category: type[Warning], *where: Any, **more: Any) -> None:
        if issubclass(category, UserWarning) and str(message) not in shown:
            shown.add(str(message))
            logging.getLogger("furuta").warning("%s", message)
            typer.echo(without_controls(f"Warning: {message}"), err=True)

    with warnings.catch_warnings():
        warnings.simplefilter("always", UserWarning)
        warnings.showwarning = show
        try:
            yield
        except BrokenPipeError:
            raise
        except EXPECTED as error:
            if traceback:
                raise
            logging.getLogger("furuta").debug("%s", type(error).__name__, exc_info=error)
            typer.echo(without_controls(f"Error: {sentence(error)}"), err=True)
            raise typer.Exit(2) from None


def sentence(error: BaseException) -> str:
    """What an error says, without Python's decoration."""
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    return str(error) or type(error).__name__
