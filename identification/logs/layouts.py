"""From the decoded variables of a MAT or NPZ file to a `Table`, whatever layout they were saved in. Pure functions.

Variables come by name: fields of structures as `struct.field`, those of arrays of structures as `struct.1.field`.
Known layouts: vectors, matrices, structures of these, structures with time (Simulink's To Workspace and scopes), pairs
of Time and Data, To File and QUARC matrices (one signal a row, time in the first), and recordings with X and Y.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from .table import Table

MAX_MATRIX_COLUMNS = 32
"""A wider matrix is not a table of samples."""
_LYING = 10  # times as many columns as rows, from which the samples of a matrix lie side by side
_SIGNAL = re.compile(r"(?P<of>.*)\.signals(\.(?P<i>\d+))?\.values")
_CHANNEL = re.compile(r"(?P<of>.*)\.(?P<side>[XY])(\.(?P<i>\d+))?\.Data")
_PAIR = re.compile(r"(?P<of>.*)\.(?P<what>[Dd]ata|[Vv]alues)")


def from_variables(name: str, variables: Mapping[str, Any]) -> Table:
    """Columns are the vectors and the columns of matrices (`data.1`, …); scalars and text are metadata.

    variables: arrays of numbers or text by name."""
    arrays = _named({key: np.asarray(value) for key, value in variables.items() if not key.startswith("__")})
    longest = max((max(array.shape) for array in arrays.values() if array.ndim and array.size), default=0)
    columns: dict[str, np.ndarray] = {}
    metadata: dict[str, str] = {}
    for key, array in arrays.items():
        array = np.squeeze(array) if array.ndim > 2 else array
        if array.ndim == 0 or (array.ndim == 1 and array.size <= 4 < longest):
            metadata[key] = " ".join(str(item) for item in np.atleast_1d(array))
        elif array.ndim == 1:
            columns[key] = array
        elif array.ndim == 2 and 1 in array.shape:
            columns[key] = array.ravel()
        elif array.ndim == 2:
            columns |= _matrix(key, array)
    units = {c: unit for c in columns if (unit := metadata.get(f"{c}.unit", metadata.get(f"{c}.units", "")))}
    return Table(name, columns, metadata, units=units)


def _matrix(key: str, array: np.ndarray) -> dict[str, np.ndarray]:
    """The columns of a matrix; its rows where samples lie side by side, as To File and QUARC write them."""
    lying = array.shape[1] >= _LYING * array.shape[0]
    array = array.T if lying else array
    if array.shape[1] > MAX_MATRIX_COLUMNS:
        return {}
    found = {f"{key}.{j + 1}": array[:, j] for j in range(array.shape[1])}
    if lying and array.dtype.kind in "fiu" and (np.diff(array[:, 0]) > 0).all():
        return {f"{key}.time": array[:, 0]} | dict(list(found.items())[1:])
    return found


def _named(arrays: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The same with signals under the names that their structures give them, and one time for all."""
    found: dict[str, np.ndarray] = {}
    for key, array in arrays.items():
        if match := _SIGNAL.fullmatch(key):
            own = key.removesuffix("values")
            label = _text(arrays, own + "label") or _text(arrays, own + "blockName").rpartition("/")[2]
            found[f"{match['of']}.{label or 'signal' + (match['i'] or '')}"] = array
        elif match := _CHANNEL.fullmatch(key):
            own = key.removesuffix("Data")
            label = _text(arrays, own + "Name").strip('"').rpartition("/")[2] or match["side"] + (match["i"] or "")
            found[f"{match['of']}.{'time' if match['side'] == 'X' else label}"] = array
        elif ".signals." not in key and not re.search(r"\.[XY](\.\d+)?\.", key):
            found[key] = array
    return _one_time(found)


def _one_time(arrays: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Signals that bring a time each, `theta.Time` and `theta.Data`, as `theta` beside one `time`."""
    pairs = {key: match["of"] for key in arrays if (match := _PAIR.fullmatch(key)) and _time_of(arrays, match["of"])}
    times = [np.ravel(arrays[_time_of(arrays, of) or ""]) for of in pairs.values()]
    if not times or any(not np.array_equal(times[0], time) for time in times[1:]):
        return arrays
    own = {_time_of(arrays, of) for of in pairs.values()}
    rest = {key: array for key, array in arrays.items() if key not in pairs and key not in own}
    return {"time": times[0]} | {of: arrays[key] for key, of in pairs.items()} | rest


def _time_of(arrays: Mapping[str, np.ndarray], of: str) -> str | None:
    return next((key for key in (f"{of}.Time", f"{of}.time") if key in arrays), None)


def _text(arrays: Mapping[str, np.ndarray], key: str) -> str:
    value = arrays.get(key)
    return str(value.ravel()[0]).strip() if value is not None and value.dtype.kind in "US" and value.size == 1 else ""
