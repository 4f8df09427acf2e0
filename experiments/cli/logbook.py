"""`-v` and `--log-file`: what a run did, for those who want to know or to keep it."""

from __future__ import annotations

import logging
import platform
import sys
from importlib.metadata import version
from pathlib import Path

import typer

LEVELS = (logging.WARNING, logging.INFO, logging.DEBUG)
_NAMES = ("furuta", "identification", "furuta_gym", "controllers", "experiments")


def keep_logbook(verbose: int, file: Path | None) -> None:
    """Send the packages' records to stderr (from a level by how often -v is given) and to a file (all of them).

    Raises ValueError for a file that cannot be written."""
    if not verbose and file is None:
        return
    handlers: list[logging.Handler] = []
    if verbose:
        stream = logging.StreamHandler(sys.stderr)
        stream.setLevel(LEVELS[min(verbose, len(LEVELS) - 1)])
        stream.setFormatter(logging.Formatter("%(levelname)s %(name)s: %(message)s"))
        handlers.append(stream)
    if file is not None:
        try:
            kept = logging.FileHandler(file, encoding="utf-8")
        except OSError as error:
            raise ValueError(f"--log-file {file}: it cannot be written ({error.strerror})") from None
        kept.setLevel(logging.DEBUG)
        kept.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(name)s: %(message)s"))
        handlers.append(kept)
    for name in _NAMES:
        logger = logging.getLogger(name)
        for old in [h for h in logger.handlers if getattr(h, "of_furuta", False)]:
            logger.removeHandler(old)
            old.close()
        logger.setLevel(min(h.level for h in handlers))
        for handler in handlers:
            handler.of_furuta = True  # type: ignore[attr-defined]
            logger.addHandler(handler)
    logging.getLogger("furuta").info("furuta %s: %s", own_version(), " ".join(sys.argv[1:]))


def own_version() -> str:
    """The version of the package."""
    return version("furuta-gym")


def print_version(wanted: bool) -> None:
    """For `--version`: print it and stop."""
    if wanted:
        typer.echo(f"furuta-gym {own_version()} (Python {platform.python_version()})")
        raise typer.Exit
