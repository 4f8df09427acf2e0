"""The long tail of a text file that holds plain numbers only, parsed in one go and with little memory."""

from __future__ import annotations

import io
from dataclasses import dataclass

import numpy as np

_HEAD = 1000  # lines that are read one by one: header, comments, and rows enough to see their form
_CHUNK = 1 << 24  # bytes
_PLAIN = b"0123456789+-.eE \r\n"
_DELIMITERS = (b"\t", b";", b",")


@dataclass(frozen=True)
class NumberBlock:
    """head: the file's first lines. values (n, columns): the numbers of the rows after them, first_line the first's."""

    head: bytes
    values: np.ndarray
    first_line: int


def number_block(raw: bytes) -> NumberBlock | None:
    """Split a file. None where it is short, or where a line of the tail is anything but numbers of the same count.

    Numbers with a decimal comma are taken where semicolons or tabs separate them.
    """
    start, last = 0, b""
    for _ in range(_HEAD):
        end = raw.find(b"\n", start)
        if end < 0:
            return None
        last, start = raw[start:end], end + 1
    lines = raw.count(b"\n", start) + (not raw.endswith(b"\n"))
    delimiter = next((d for d in _DELIMITERS if d in last), b"")
    comma = delimiter != b"," and b"," in last
    allowed = _PLAIN + delimiter + (b"," if comma else b"")
    chunks = range(start, len(raw), _CHUNK)
    if lines < _HEAD or any(raw[i : i + _CHUNK].translate(None, allowed) for i in chunks):
        return None
    if raw.count(b"\r", start) != raw.count(b"\r\n", start):
        return None
    stream = io.BytesIO(raw)
    stream.seek(start)
    if comma:
        stream = io.BytesIO(raw[start:].replace(b",", b"."))
    try:
        values = np.loadtxt(stream, delimiter=delimiter.decode() or None, comments=None, ndmin=2, encoding="ascii")
    except ValueError:
        return None
    return NumberBlock(raw[:start], values, _HEAD + 1) if len(values) == lines else None
