"""Files that are whole or not there, one writer at a time, and JSON of strangers."""

from __future__ import annotations

import json
import os
import platform
import re
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path
from typing import Any

DEEPEST = 64  # levels of nesting in a file of this project; the real ones have six
_LARGEST = 1e308


def read_json(text: str | bytes) -> Any:
    """JSON as this project writes it: finite numbers that fit a float, at most `DEEPEST` levels.

    Raises ValueError (json.JSONDecodeError and UnicodeDecodeError are such) with the reason.
    """

    def refuse(constant: str) -> None:
        raise ValueError(f"{constant} is no number of JSON")

    too_deep = f"the file is nested deeper than {DEEPEST} levels"
    try:
        data = json.loads(text, parse_constant=refuse)
    except RecursionError:
        raise ValueError(too_deep) from None
    level = [data]
    for _ in range(DEEPEST):
        if not level:
            return data
        below: list[Any] = []
        for value in level:
            if isinstance(value, dict):
                below += value.values()
            elif isinstance(value, list):
                below += value
            elif isinstance(value, int | float) and not abs(value) <= _LARGEST:
                raise ValueError("a number of the file is larger than 1e308")
        level = below
    raise ValueError(too_deep)


def in_short(error: Exception | str, most: int = 500) -> str:
    """What an error says of a file, without the middle of what the file holds. Words near the cut stay whole."""
    text = str(error)
    if len(text) <= most:
        return text
    head, tail = text[: most - 100], text[-90:]
    head = re.sub(r"\s+\S{0,60}$", "", head) if not text[most - 100].isspace() else head
    tail = re.sub(r"^\S{0,60}\s+", "", tail) if not text[-91].isspace() else tail
    return f"{head} … {tail}"


def told_apart(paths: Sequence[Path]) -> list[str]:
    """For each of different paths its shortest end that no other one has, `log.csv` or `run1/log.csv`."""

    def end(path: Path, parts: int) -> str:
        return "/".join(path.parts[-parts:])

    def parts(path: Path) -> int:
        others = [other for other in paths if other != path]
        return next(n for n in count(1) if n >= len(path.parts) or all(end(o, n) != end(path, n) for o in others))

    return [end(path, parts(path)) for path in paths]


def write_whole(path: str | os.PathLike[str], data: bytes | str) -> Path:
    """Write a file (text as UTF-8) whole or not at all; see `whole_file`.

    Of a file name that is no UTF-8, the bytes that are none are written as JSON writes them, as \\udce4."""
    with whole_file(path) as new:
        new.write_bytes(data.encode(errors="backslashreplace") if isinstance(data, str) else data)
    return Path(path)


@contextmanager
def whole_file(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A name with the same ending to write to, beside `path`; then to the disk, and to `path` by one rename.

    Folders above it are made. Raises OSError that names `path`, whatever file was in the way.
    """
    path = Path(path)
    kind = f"new{path.suffix}"
    temporary = temporary_name(path, kind)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        remove_stale(path, re.escape(kind))
        yield temporary
        with open(temporary, "rb+") as file:
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except OSError as error:
        if error.errno is None:  # of a library, in its own words
            raise OSError(f"{path}: {error}") from None
        raise type(error)(error.errno, error.strerror or str(error), str(path)) from None
    finally:
        with suppress(OSError):  # the error of the file that the user knows is the one to be told
            temporary.unlink(missing_ok=True)
    sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Bring the names in a folder to the disk, where the system can."""
    with suppress(OSError):  # Windows opens no folders
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def temporary_name(path: Path, kind: str = "new") -> Path:
    """A name beside `path` on the same file system, that tells who writes there: another one for each thread."""
    return path.with_name(f".{path.name}.{_host()}-{os.getpid()}-{threading.get_ident()}.{kind}")


def stale(path: Path, kind: str = "new") -> list[Path]:
    """What processes of this machine that are gone left beside `path` under `temporary_name`."""
    pattern = re.compile(rf"\.{re.escape(path.name)}\.{re.escape(_host())}-(\d+)(?:-\d+)?\.{kind}")
    found = []
    with suppress(OSError):
        for entry in os.scandir(path.parent):
            match = pattern.fullmatch(entry.name)
            if match and not _alive(int(match[1])):
                found.append(Path(entry.path))
    return found


def remove_stale(path: Path, kind: str = "new") -> None:
    """Remove the files of `stale`."""
    for left in stale(path, kind):
        with suppress(OSError):
            left.unlink()


def _host() -> str:
    return re.sub(r"\W", "_", platform.node(), flags=re.ASCII)[:32]


def _alive(process: int) -> bool:
    if os.name == "nt":  # os.kill would end it there
        return True
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:
        pass
    return True


@contextmanager
def locked(path: str | os.PathLike[str]) -> Iterator[None]:
    """Be the only one that writes to `path` (a file or a folder), across processes.

    Raises ValueError at once if another process holds it. A lock ends with its process, however that ends.
    """
    from filelock import FileLock, Timeout

    path = Path(path).absolute()
    room = path if path.is_dir() and not os.access(path.parent, os.W_OK) else path.parent
    file = room / f".{path.name}.lock"
    file.parent.mkdir(parents=True, exist_ok=True)
    lock = FileLock(file, timeout=0)
    try:
        lock.acquire()
    except Timeout:
        raise ValueError(
            f"{path} is being written by another furuta; wait until that ends, or choose another output"
        ) from None
    try:
        yield
    finally:
        file.unlink(missing_ok=True)  # while it is held: who waits for the old file sees that it is gone
        lock.release()
