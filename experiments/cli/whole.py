"""Folders of results that are replaced whole or not at all, also on a full disk and when the process is killed."""

from __future__ import annotations

import ctypes
import errno
import os
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from furuta_gym.files import locked, stale, sync_folder, temporary_name

_DISK = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EIO)
_EXCHANGE = 2  # RENAME_EXCHANGE of Linux
_HERE = -100  # AT_FDCWD


@contextmanager
def whole_folder(path: Path, own: Iterable[str] = ()) -> Iterator[Path]:
    """A folder to write in, which takes the place of `path` at the end and is thrown away on an error.

    It lies beside `path`, and what was there stands until all of the new files are on the disk. own: names that belong
    to the command; what an earlier run left there under them does not stay beside new files. Other files of `path`
    stay, and then the new files go there one by one. Raises ValueError while another furuta writes to `path`, and
    OSError that names the file in `path`.
    """
    target = Path(os.path.realpath(path))
    with locked(target):
        recover(target)
        room = target if target.is_dir() and not _beside(target) else target.parent
        new = temporary_name(room / target.name)
        try:
            room.mkdir(parents=True, exist_ok=True)
            new.mkdir()
            yield new
            _sync(new)
            _install(new, target, set(own))
        except OSError as error:
            raise _named(error, new, path) from None
        finally:
            shutil.rmtree(new, ignore_errors=True)


def recover(target: Path) -> None:
    """Put back the folder that a killed process was about to replace, and remove what it left."""
    for old in stale(target, "old"):
        if target.exists():
            shutil.rmtree(old, ignore_errors=True)
        else:
            os.rename(old, target)
    for place in (target, target / target.name):
        for left in stale(place):
            shutil.rmtree(left, ignore_errors=True)


def _beside(target: Path) -> bool:
    """Whether a folder can be made beside `target`, on its file system."""
    return os.access(target.parent, os.W_OK) and target.stat().st_dev == target.parent.stat().st_dev


def _install(new: Path, target: Path, own: set[str]) -> None:
    written = sorted(file.name for file in new.iterdir())
    if not target.exists():
        os.rename(new, target)
    elif new.parent == target.parent and _only(target, own | set(written)) and not Path.cwd().is_relative_to(target):
        _swap(new, target)
    else:
        for name in written:
            _put(new / name, target / name)
        for name in own - set(written):
            _remove(target / name)
        sync_folder(target)
    sync_folder(target.parent)


def _only(folder: Path, names: set[str]) -> bool:
    return not folder.is_mount() and names.issuperset(os.listdir(folder))


def _put(new: Path, place: Path) -> None:
    """A file or a folder in its place, over what is there."""
    if place.is_dir() and not place.is_symlink():
        _swap(new, place)
        shutil.rmtree(new, ignore_errors=True)
    else:
        os.replace(new, place)


def _remove(place: Path) -> None:
    if place.is_dir() and not place.is_symlink():
        shutil.rmtree(place, ignore_errors=True)
    else:
        place.unlink(missing_ok=True)


def _swap(new: Path, target: Path) -> None:
    """Exchange two folders in one step where the system can, else by way of a third name that `recover` knows."""
    new.chmod(target.stat().st_mode & 0o7777)
    with suppress(AttributeError, OSError, TypeError):
        exchange = ctypes.CDLL(None, use_errno=True).renameat2
        if exchange(_HERE, os.fsencode(new), _HERE, os.fsencode(target), _EXCHANGE) == 0:
            return
    old = temporary_name(target, "old")
    os.rename(target, old)
    os.rename(new, target)
    shutil.rmtree(old, ignore_errors=True)


def _sync(folder: Path) -> None:
    for entry in folder.iterdir():
        if entry.is_dir():
            _sync(entry)
        else:
            with open(entry, "rb") as written:
                os.fsync(written.fileno())
    sync_folder(folder)


def _named(error: OSError, new: Path, path: Path) -> OSError:
    """The error with the name that the user knows."""
    name = error.filename
    if isinstance(name, str | os.PathLike) and Path(name).is_relative_to(new):
        name = path / Path(name).relative_to(new)
    elif name is None and error.errno in _DISK:
        name = path
    else:
        return error
    return type(error)(error.errno, error.strerror, str(name))
