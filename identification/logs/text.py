"""What people put into text files besides numbers: other encodings, units below the names, dates, comments."""

from __future__ import annotations

import gzip
import io
import re
import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from .checks import LogError
from .table import number
from .vocabulary import unit_of

COMMENTS = ("#", "%", "//", "!")
"""What a line of comment starts with."""

_HALF_A_DAY = np.timedelta64(12, "h")
_LARGEST = 1 << 30  # bytes of a packed file when unpacked
_DAY_AND_CLOCK = re.compile(
    r"\s*(?:(\d{1,2})([./-])(\d{1,2})\2(\d{4})[T ,]\s*)?(\d{1,2}):(\d{2}):(\d{2})(?:[.,](\d+))?\s*([AaPp][Mm])?\s*"
)
_DATE = re.compile(r"\s*\d{4}-\d{2}-\d{2}([T ]\d{2}:\d{2}(:\d{2}([.,]\d+)?)?)?\s*(Z|[+-]\d{2}:?\d{2})?\s*")


def unpacked(path: Path) -> bytes:
    """The bytes of a file, unpacked where its name ends in .gz. Raises LogError."""
    raw = path.read_bytes()
    return _unpacked(path.name, raw) if path.suffix.lower() == ".gz" else raw


def decoded(name: str, raw: bytes) -> tuple[str, tuple[str, ...]]:
    """The text that bytes of a file are, and a note where it is not in UTF-8. Raises LogError for what is no text."""
    if raw[:2] in (b"\xff\xfe", b"\xfe\xff"):  # Windows tools call it Unicode
        return _clean(name, raw.decode("utf-16", errors="replace")), ()
    try:
        return _clean(name, raw.decode("utf-8-sig")), ()
    except UnicodeDecodeError:
        if b"\0" in raw:
            raise LogError(f"{name}: holds zero bytes, so it is not a text file. Save it as CSV in UTF-8.") from None
    if not _readable(raw):
        raise LogError(f"{name}: not a text file in UTF-8 or Latin-1. Save it as CSV in UTF-8.")
    try:
        text, encoding = raw.decode("cp1252"), "Windows-1252"
    except UnicodeDecodeError:
        text, encoding = raw.decode("latin-1"), "Latin-1"
    return text, (f"{name}: not in UTF-8; read as {encoding}. Look whether its column names are right.",)


def _unpacked(name: str, raw: bytes) -> bytes:
    try:
        with gzip.GzipFile(fileobj=io.BytesIO(raw)) as packed:
            data = packed.read(_LARGEST + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise LogError(f"{name}: not a readable gzip file ({error}).") from None
    if len(data) > _LARGEST:
        raise LogError(f"{name}: more than {_LARGEST >> 20} MB when unpacked. Expected a log; cut it into parts.")
    return data


def _clean(name: str, text: str) -> str:
    if "\0" in text:
        raise LogError(f"{name}: holds zero bytes, so it is not a text file. Save it as CSV in UTF-8.")
    return text


def _readable(raw: bytes) -> bool:
    """Whether bytes are text of one byte a letter: few letters beyond ASCII, no control characters."""
    head = np.frombuffer(raw[:100_000], dtype=np.uint8)
    control = (head < 32) & ~np.isin(head, (9, 10, 12, 13))
    return not control.any() and float(np.mean(head > 126)) < 0.2


def comment_of(line: str) -> str | None:
    """The text of a line of comment, None for another line."""
    bare = line.lstrip()
    start = next((c for c in COMMENTS if bare.startswith(c)), None)
    return None if start is None else bare[len(start) :].lstrip(" #%/!").rstrip()


def units_row(header: Sequence[str], row: Sequence[str]) -> dict[str, str]:
    """Units by column, where the row below the names holds those and no numbers; else empty."""
    cells = [cell.strip() for cell in row[: len(header)]]
    if len(cells) < len(header) or any(number(cell) is not None for cell in cells):
        return {}
    known = [cell for cell in cells if unit_of(cell)]
    return dict(zip(header, cells, strict=True)) if known and all(unit_of(c) or c in ("", "-") for c in cells) else {}


def dates(cells: Sequence[str]) -> np.ndarray | None:
    """Cells as dates, where all are written as ISO 8601 has them, as 3.5.2024 14:02:03 or as 05/03/2024 02:02:03 PM, or
    are times of the day; else None. A time zone is taken into account."""
    if not cells:
        return None
    if all(_DAY_AND_CLOCK.fullmatch(cell) for cell in (cells[0], cells[-1])):
        return _days_and_clocks(cells)
    if not all(_DATE.fullmatch(cell) for cell in (cells[0], cells[-1])):
        return None
    import pandas as pd

    try:
        stamps = pd.to_datetime([c.strip().replace(",", ".") for c in cells], format="ISO8601", utc=True)
    except ValueError:
        return None
    return stamps.tz_localize(None).to_numpy().astype("datetime64[ns]")


def _days_and_clocks(cells: Sequence[str]) -> np.ndarray | None:
    """Dates, day and month in the order in which they take the least time, or times of the day, which may pass
    midnight. None where cells are not all written as the first one."""
    import pandas as pd

    day, sign, _, _, _, _, _, fraction, half = _DAY_AND_CLOCK.fullmatch(cells[0]).groups()  # type: ignore[union-attr]
    clock = f"{'%H' if half is None else '%I'}:%M:%S{'' if fraction is None else '.%f'}{'' if half is None else ' %p'}"
    text = pd.Series(cells).str.strip().str.replace(r",(?=\d+\s*\D*$)", ".", regex=True)

    def read(form: str) -> np.ndarray | None:
        try:
            return pd.to_datetime(text, format=form).to_numpy().astype("datetime64[ns]")
        except ValueError:
            return None

    if day is None:
        times = read(clock)
        if times is None:
            return None
        return times + np.cumsum(np.diff(times, prepend=times[:1]) < -_HALF_A_DAY) * np.timedelta64(1, "D")
    orders = [read(f"%{a}{sign}%{b}{sign}%Y {clock}") for a, b in ("dm", "md")]
    return min((s for s in orders if s is not None), key=lambda s: abs(s[-1] - s[0]), default=None)
