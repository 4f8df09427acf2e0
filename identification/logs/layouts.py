"""From the decoded variables of a MAT or NPZ file to a `Table`, whatever layout they were saved in. Pure functions.

Known: vectors, matrices, structures (of structures) of these, structures with time as Simulink's To Workspace writes
them, timeseries objects as structures, To File matrices (time in the first of few rows), QUARC and dSPACE recordings.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .table import Table

_MAX_MATRIX_COLUMNS = 32  # a wider matrix is not a table of samples
_DEEPEST = 6
_LEAST_ROWS = 20  # a matrix with fewer rows than this and ten times as many columns has its samples in columns


def from_variables(name: str, variables: Mapping[str, Any]) -> Table:
    """Columns are the vectors and the columns of matrices (`data.1`, …); scalars and text are metadata.

    variables: arrays, numbers, text, mappings, objects with `_fieldnames` (scipy's structures) and lists of these."""
    flat: dict[str, Any] = {}
    for key, value in variables.items():
        if not key.startswith("__"):
            flat |= _opened(key, value)
    arrays = {key: np.asarray(value) for key, value in flat.items()}
    longest = max((max(array.shape) for array in arrays.values() if array.ndim and array.size), default=0)
    columns: dict[str, np.ndarray] = {}
    metadata: dict[str, str] = {}
    units: dict[str, str] = {}
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
    for key in [k for k in metadata if k.endswith((".units", ".unit", ".Unit", ".Units"))]:
        units |= {c: metadata[key] for c in columns if c.startswith(key.rpartition(".")[0] + ".")}
    units |= {key: unit for key, unit in units.items() if key in columns}
    return Table(name, _renamed(columns), metadata, units={_short(k): u for k, u in units.items()})


def _matrix(key: str, array: np.ndarray) -> dict[str, np.ndarray]:
    """The columns of a matrix; its rows where samples lie side by side, as To File writes them."""
    rows, columns = array.shape
    lying = rows <= _LEAST_ROWS and columns >= 10 * rows
    if lying:
        array = array.T
    if array.shape[1] > _MAX_MATRIX_COLUMNS:
        return {}
    if lying and array.shape[1] > 1 and (np.diff(array[:, 0].astype(float, copy=False)) > 0).all():
        rest = {f"{key}.{j}": array[:, j] for j in range(1, array.shape[1])}
        return {f"{key}.time": array[:, 0]} | rest
    return {f"{key}.{j + 1}": array[:, j] for j in range(array.shape[1])}


def _opened(key: str, value: Any, depth: int = 0) -> dict[str, Any]:
    """A structure as its fields, `key.field`; a structure with time as its signals, each by its own name."""
    fields = _fields(value)
    if fields is None or depth > _DEEPEST:
        if isinstance(value, list | tuple) or (isinstance(value, np.ndarray) and value.dtype == object and value.size):
            parts = list(np.atleast_1d(np.asarray(value, dtype=object)).ravel()) if not isinstance(value, list) else value
            if any(_fields(part) is not None for part in parts) and len(parts) <= _MAX_MATRIX_COLUMNS:
                return _list_of_structures(key, parts, depth)
            if not isinstance(value, np.ndarray):
                return {}
        return {} if fields is not None else {key: value}
    found: dict[str, Any] = {}
    named = _signals(key, fields) or _channels(key, fields)
    if named is not None:
        return named
    for sub, inner in fields.items():
        found |= _opened(f"{key}.{sub}", inner, depth + 1)
    return found


def _list_of_structures(key: str, parts: Sequence[Any], depth: int) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for i, part in enumerate(parts, 1):
        fields = _fields(part)
        if fields is None:
            continue
        label = next((_text(fields[n]) for n in ("name", "label", "Name", "blockName") if _text(fields.get(n))), str(i))
        found |= _opened(f"{key}.{label}", {k: v for k, v in fields.items() if k not in ("name", "label", "Name")}, depth + 1)
    return found


def _signals(key: str, fields: Mapping[str, Any]) -> dict[str, Any] | None:
    """A structure with time: `time` and `signals`, each with `values` and a `label`."""
    if "signals" not in fields:
        return None
    signals = fields["signals"]
    parts = [signals] if _fields(signals) is not None else list(np.atleast_1d(np.asarray(signals, dtype=object)).ravel())
    found: dict[str, Any] = {}
    if np.size(fields.get("time", ())):
        found[f"{key}.time"] = fields["time"]
    for i, part in enumerate(parts, 1):
        inner = _fields(part)
        if inner is None or "values" not in inner:
            continue
        label = _text(inner.get("label")) or _text(inner.get("blockName")).rpartition("/")[2] or f"signal{i}"
        found[f"{key}.{label}"] = inner["values"]
    return found


def _channels(key: str, fields: Mapping[str, Any]) -> dict[str, Any] | None:
    """A recording of dSPACE or of a measurement card: X (time) and Y (signals), each with `Name` and `Data`."""
    if "Y" not in fields or "X" not in fields:
        return None
    found: dict[str, Any] = {}
    for side in ("X", "Y"):
        value = fields[side]
        parts = [value] if _fields(value) is not None else list(np.atleast_1d(np.asarray(value, dtype=object)).ravel())
        for i, part in enumerate(parts, 1):
            inner = _fields(part)
            if inner is None or "Data" not in inner:
                return None
            label = _text(inner.get("Name")).strip('"').replace("Model Root/", "") or f"{side}{i}"
            found[f"{key}.{'time' if side == 'X' and len(parts) == 1 else label}"] = inner["Data"]
    return found


def _fields(value: Any) -> dict[str, Any] | None:
    """The fields of a structure, None for anything else."""
    if isinstance(value, Mapping):
        return {str(k): v for k, v in value.items()}
    if hasattr(value, "_fieldnames"):
        return {k: getattr(value, k) for k in value._fieldnames}
    return None


def _text(value: Any) -> str:
    if isinstance(value, np.ndarray) and value.size == 1:
        value = value.item()
    return value.strip() if isinstance(value, str) else ""


def _renamed(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Without what encloses every column twice over: `recording.data.theta` is `data.theta`, if no two are the same."""
    short = {key: _short(key) for key in columns}
    if len(set(short.values())) < len(short):
        return columns
    return {short[key]: values for key, values in columns.items()}


def _short(key: str) -> str:
    return re.sub(r"^(.*)\.(values|Data|data)$", r"\1", key)
