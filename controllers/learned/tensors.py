"""Named arrays in one file, in the format safetensors: a JSON header and raw numbers, nothing that could be run."""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from furuta_gym.files import read_json

_DTYPES = {"F32": np.dtype("<f4"), "F64": np.dtype("<f8"), "I64": np.dtype("<i8"), "U8": np.dtype("u1")}
_NAMES = {dtype: name for name, dtype in _DTYPES.items()}
_LONGEST_HEADER = 1 << 20


def to_bytes(tensors: Mapping[str, NDArray[Any]]) -> bytes:
    """The file's content. Raises ValueError for a type other than float32, float64, int64 and uint8."""
    header: dict[str, Any] = {}
    parts = []
    start = 0
    for name, array in tensors.items():
        array = np.asarray(array)
        dtype = array.dtype.newbyteorder("<")
        if dtype not in _NAMES:
            raise ValueError(f"{name}: arrays of {array.dtype} cannot be kept; expected one of {', '.join(_DTYPES)}")
        raw = array.astype(dtype).tobytes()
        header[name] = {"dtype": _NAMES[dtype], "shape": list(array.shape), "data_offsets": [start, start + len(raw)]}
        parts.append(raw)
        start += len(raw)
    text = json.dumps(header, ensure_ascii=False).encode()
    text += b" " * (-len(text) % 8)
    return b"".join([struct.pack("<Q", len(text)), text, *parts])


def from_bytes(raw: bytes) -> dict[str, NDArray[Any]]:
    """The arrays of a file, each with as many bytes as its shape takes. Raises ValueError on anything else."""
    if len(raw) < 8:
        raise ValueError("the arrays are cut off")
    (length,) = struct.unpack_from("<Q", raw)
    if length > min(_LONGEST_HEADER, len(raw) - 8):
        raise ValueError("the header of the arrays is cut off")
    header = read_json(raw[8 : 8 + length])
    if not isinstance(header, dict):
        raise ValueError("the header of the arrays must be a mapping")
    header.pop("__metadata__", None)
    body = memoryview(raw)[8 + length :]
    found = {}
    end = 0
    for name, entry in header.items():
        dtype, shape, start, stop = _entry(name, entry)
        if start != end or stop > len(body) or stop - start != math.prod(shape) * dtype.itemsize:
            raise ValueError(f"array {name!r}: its bytes do not fit its shape {tuple(shape)}")
        found[name] = np.frombuffer(body[start:stop], dtype).reshape(shape).copy()
        end = stop
    if end != len(body):
        raise ValueError("there are bytes that belong to no array")
    return found


def _entry(name: str, entry: Any) -> tuple[np.dtype[Any], list[int], int, int]:
    try:
        dtype, shape, (start, stop) = _DTYPES[entry["dtype"]], entry["shape"], entry["data_offsets"]
        whole = all(type(n) is int and 0 <= n < 2**40 for n in (*shape, start, stop))
        if not whole or not isinstance(shape, list) or len(shape) > 8:
            raise ValueError
    except (KeyError, TypeError, ValueError):
        raise ValueError(f"array {name!r}: expected a known dtype, a shape and two offsets, got {entry!r}") from None
    return dtype, shape, start, stop
