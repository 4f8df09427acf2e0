"""What stands at a path before anything of it is read, and how much a file may unfold to."""

from __future__ import annotations

import errno
import os
import stat
from contextlib import suppress
from pathlib import Path

from .checks import LogError

MOST_CELLS = 500_000_000
"""Numbers that a file may hold: four columns of an hour at 30 kHz. A small file can declare far more than that."""

_KINDS = {
    stat.S_IFIFO: "is a pipe, whose end nobody knows",
    stat.S_IFSOCK: "is a socket",
    stat.S_IFCHR: "is a device",
    stat.S_IFBLK: "is a device",
    stat.S_IFDIR: "is a folder",
}


def check_file(path: Path) -> None:
    """Raise `LogError`, saying what is there instead, unless `path` is a file that can be read."""
    what = _instead(path)
    if not what:
        return
    nearby: list[str] = []
    folder, pattern = (path, "*.*") if os.path.isdir(path) else (path.parent, f"*{path.suffix or '.*'}")
    with suppress(OSError, ValueError):  # a name that is none
        nearby = sorted(p.name for p in folder.glob(pattern) if p != path and p.is_file())[:5]
    hint = f" In that folder: {', '.join(nearby)}." if nearby else ""
    raise LogError(f"{path}: this log {what}. Expected a file.{hint}")


def _instead(path: Path) -> str:
    """What is wrong with a path in words; empty if it leads to a file that can be read."""
    try:
        about = path.stat()
    except ValueError:
        return "has a name that no file can have"
    except OSError as error:
        if error.errno == errno.ELOOP:
            return "is a link that leads back to itself"
        if error.errno == errno.ENOENT and path.is_symlink():
            return f"is a link to {os.readlink(path)}, which does not exist"
        if error.errno in (errno.ENOENT, errno.ENOTDIR):
            return "does not exist"
        return f"cannot be looked at ({error.strerror})"
    if not stat.S_ISREG(about.st_mode):
        return _KINDS.get(stat.S_IFMT(about.st_mode), "is no file")
    return "" if os.access(path, os.R_OK) else "may not be read by this user"


def check_cells(name: str, cells: int) -> None:
    """Raise `LogError` for more numbers than `MOST_CELLS`."""
    if cells > MOST_CELLS:
        raise LogError(f"{name}: declares {cells:.3g} numbers. Expected at most {MOST_CELLS:.0g}; is the file damaged?")
