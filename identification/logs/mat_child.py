"""Variables of a MAT file, in a child process: scipy's reader can die of a damaged one. See `apart_child`."""

from typing import Any

import numpy as np

_DEPTH = 6  # levels of structs that are opened
_PARTS = 64  # structs in an array that are opened
_TEXT = 80  # letters kept of what is neither numbers nor text


def plain(name: str, value: Any, depth: int = 0) -> dict[str, np.ndarray]:
    """Arrays of numbers and text by name: fields of structs as `struct.field`, of arrays of them as `struct.1.field`,
    anything else as short text."""
    if _is_struct(value) and depth < _DEPTH:
        fields = value if isinstance(value, dict) else {f: getattr(value, f) for f in value._fieldnames}
        found: dict[str, np.ndarray] = {}
        for field, inner in fields.items():
            found |= plain(f"{name}.{field}", inner, depth + 1)
        return found
    if isinstance(value, list):
        array = np.empty(len(value), dtype=object)
        array[:] = value
        array = array if any(_is_struct(part) for part in value) else np.asarray(value)
    else:
        array = np.asarray(value)
    parts = array.ravel().tolist() if array.dtype.kind == "O" and array.size <= _PARTS else []
    if any(_is_struct(part) for part in parts) and depth < _DEPTH:  # an array of structs, or cells
        found = {}
        for number, part in enumerate(parts, 1):
            found |= plain(f"{name}.{number}", part, depth + 1)
        return found
    if array.dtype.kind not in "biufcUSMm":
        items = [str(item)[:_TEXT] for item in array.ravel().tolist()]
        array = np.array(items, dtype=str).reshape(array.shape)
    return {name: array}


def _is_struct(value: object) -> bool:
    return isinstance(value, dict) or hasattr(value, "_fieldnames")


def newer(path: str) -> dict:
    """Variables of a file of version 7.3. Raises ImportError without the package for it."""
    from pymatreader import read_mat

    return read_mat(path)


def read(path: str) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """No facts, and arrays by name, structs opened as `struct.field`."""
    from scipy.io import loadmat

    try:
        variables = loadmat(path, squeeze_me=True, struct_as_record=False)
    except NotImplementedError:
        variables = newer(path)
    flat: dict[str, np.ndarray] = {}
    for name, value in variables.items():
        if not name.startswith("__"):
            flat |= plain(name, value)
    return {}, flat
