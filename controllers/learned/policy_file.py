"""Policy files: settings as JSON and weights as plain numbers in one zip. Reading one runs nothing of what it holds.

policy.json           the training record and, as "network", the shapes, activations and limit of the network
weights.safetensors   "scale", and "weight0", "bias0", … of its layers; "cells_w", "cells_r", "cells_bias" of its cells
learning.safetensors  everything that learning goes on from, see `learning_state`; may be left out
"""

from __future__ import annotations

import io
import json
import os
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from msgspec import UNSET, Meta, Struct, UnsetType
from numpy.typing import NDArray

from furuta_gym.declared import checked, written
from furuta_gym.files import in_short, read_json, write_whole

from . import tensors
from .cells import Cells
from .layers import ACTIVATIONS, Layer, Network

SCHEMA = "furuta-policy/1"
RECORD, WEIGHTS, LEARNING = "policy.json", "weights.safetensors", "learning.safetensors"

_LARGEST = 1 << 26  # bytes of one member
_BROKEN = (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError, OSError, ValueError, zlib.error)
"""What zipfile raises for one that is damaged; OSError where it is led to a place before the file's start."""


class LayerEntry(Struct):
    inputs: int
    outputs: int
    activation: str


class CellsEntry(Struct):
    count: Annotated[int, Meta(ge=1, le=1024)]
    beside: Annotated[bool, Meta(description="Whether the observation goes beside the cells too")]


class NetworkEntry(Struct):
    """The "network" of policy.json."""

    observation_size: int
    layers: Annotated[list[LayerEntry], Meta(min_length=1, max_length=32)]
    squash: Literal["tanh", "clip"]
    limit: Annotated[float, Meta(gt=0)]
    cells: CellsEntry | UnsetType = UNSET


def write_policy(
    path: str | os.PathLike[str],
    network: Network,
    record: Mapping[str, Any],
    learning: Mapping[str, NDArray[Any]] | None = None,
) -> Path:
    """Write a policy file, whole or not at all; equal arguments give equal bytes.

    Raises ValueError for a network that `read_policy` would refuse."""
    arrays: dict[str, NDArray[Any]] = {"scale": np.asarray(network.scale, dtype=np.float32)}
    for i, layer in enumerate(network.layers):
        arrays |= {f"weight{i}": layer.weight, f"bias{i}": layer.bias}
    if (cells := network.cells) is not None:
        arrays |= {"cells_w": cells.w, "cells_r": cells.r, "cells_bias": cells.bias}
    about = dict(record) | {"schema": SCHEMA, "network": written(_described(network))}
    _network(about["network"], arrays)
    members = {
        RECORD: (json.dumps(about, indent=2, ensure_ascii=False, allow_nan=False) + "\n").encode(),
        WEIGHTS: tensors.to_bytes(arrays),
    }
    if learning is not None:
        members[LEARNING] = tensors.to_bytes(learning)
    raw = io.BytesIO()
    with zipfile.ZipFile(raw, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            archive.writestr(zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), data, zipfile.ZIP_DEFLATED)
    return write_whole(path, raw.getvalue())


def read_policy(path: str | os.PathLike[str], trust: bool = False) -> tuple[Network, dict[str, Any]]:
    """The network and the training record of a policy file.

    trust: read a file of stable-baselines3 too, with the record beside it (`policy.json` beside `policy.zip`). That
    runs whatever code is in it. Raises FileNotFoundError, or ValueError with the file's name.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"no policy at {path}; train one with `furuta train … -o {path}`")
    if from_stable_baselines3(path):
        from .sb3_files import read_sb3

        if not trust:
            raise ValueError(refusal(path))
        return read_sb3(path, read_record(path))
    members = _members(path, (RECORD, WEIGHTS))
    try:
        record = _record(members[RECORD])
        network = _network(record.pop("network", None), tensors.from_bytes(members[WEIGHTS]))
    except ValueError as error:
        raise ValueError(f"{path}: cannot be read as a policy: {in_short(error)}") from error
    return network, record


def read_learning(path: str | os.PathLike[str]) -> dict[str, NDArray[Any]]:
    """What learning goes on from. Raises ValueError where a policy file has none."""
    members = _members(Path(path), (LEARNING,), "it holds the network alone, so learning cannot go on from it")
    try:
        return tensors.from_bytes(members[LEARNING])
    except ValueError as error:
        raise ValueError(f"{path}: cannot be read as a policy: {in_short(error)}") from error


def read_record(path: str | os.PathLike[str]) -> dict[str, Any]:
    """The training record of a policy: the one inside it; for a file of stable-baselines3 the one beside it.

    Empty if there is no file or no record. Raises ValueError with the name of the file that cannot be read.
    """
    path = Path(path)
    if path.exists() and not from_stable_baselines3(path):
        raw, where = _members(path, (RECORD,))[RECORD], path
    else:
        where = path.with_suffix(".json")
        if not path.exists() or not where.exists():
            return {}
        raw = where.read_bytes()
    try:
        record = _record(raw)
    except ValueError as error:
        raise ValueError(f"{where}: the training record cannot be read: {in_short(error)}") from error
    record.pop("network", None)
    return record


def refusal(path: Path) -> str:
    """Why a file of stable-baselines3 is not read."""
    return (
        f"{path} was saved by stable-baselines3, and reading such a file runs any code that is in it; if you trust who "
        "made it, say --trust (in Python trust=True)"
    )


def from_stable_baselines3(path: Path) -> bool:
    """Whether a file has the members of a stable-baselines3 zip; looks at their names only."""
    try:
        with zipfile.ZipFile(path) as archive:
            names = set(archive.namelist())
    except (zipfile.BadZipFile, NotImplementedError, OSError, ValueError):
        return False
    return "data" in names and RECORD not in names


def _members(path: Path, names: tuple[str, ...], missing: str = "") -> dict[str, bytes]:
    found = {}
    try:
        with zipfile.ZipFile(path) as archive:
            for name in names:
                info = archive.getinfo(name)
                if info.file_size > _LARGEST:
                    raise ValueError(f"{name} is larger than {_LARGEST >> 20} MB")
                with archive.open(info) as member:
                    found[name] = member.read(_LARGEST + 1)  # the size above is what the file says of itself
                if len(found[name]) != info.file_size:
                    raise ValueError(f"{name} has another size than the zip says")
    except KeyError as error:
        reason = missing or f"it has no {error.args[0].split(chr(39))[1]}"
        raise ValueError(f"{path}: no policy that `furuta train` wrote: {reason}") from None
    except _BROKEN as error:
        raise ValueError(f"{path}: no policy that `furuta train` wrote: {in_short(error)}") from None
    return found


def _record(raw: bytes) -> dict[str, Any]:
    if len(raw) > 1 << 20:
        raise ValueError("the training record is larger than 1 MB")
    try:
        record = read_json(raw)
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"the training record is not JSON: {error}") from None
    if not isinstance(record, dict):
        raise ValueError('a training record is a mapping with "algorithm" and "env"')
    schema = record.get("schema", SCHEMA)
    if schema != SCHEMA:
        raise ValueError(f'expected "schema": "{SCHEMA}", got {schema!r}')
    return record


def _described(network: Network) -> NetworkEntry:
    cells = network.cells
    return NetworkEntry(
        network.size,
        [LayerEntry(layer.weight.shape[1], layer.weight.shape[0], layer.activation) for layer in network.layers],
        "tanh" if network.squashed else "clip",
        network.limit,
        UNSET if cells is None else CellsEntry(cells.size, cells.beside),
    )


def _network(said: Any, arrays: Mapping[str, NDArray[Any]]) -> Network:
    """The network that a file says it has, held against the arrays that are there."""
    read = checked(said, NetworkEntry, "network")
    size = read.observation_size
    scale = _array(arrays, "scale", (size,))
    cells = None if read.cells is UNSET else _cells(read.cells, size, arrays)
    made = []
    width = size if cells is None else cells.outputs
    for i, layer in enumerate(read.layers):
        if layer.activation != "" and layer.activation not in ACTIVATIONS:
            raise ValueError(f'the activation of layer {i} must be "" or one of {", ".join(ACTIVATIONS)}')
        if layer.inputs != width:
            raise ValueError(f"layer {i} takes {layer.inputs} numbers, and {width} come in")
        width = layer.outputs
        weight, bias = _array(arrays, f"weight{i}", (width, layer.inputs)), _array(arrays, f"bias{i}", (width,))
        made.append(Layer(weight, bias, layer.activation))
    if width != 1:
        raise ValueError(f"the last layer must have one output, got {width}")
    return Network(scale, tuple(made), read.squash == "tanh", read.limit, cells)


def _cells(said: CellsEntry, inputs: int, arrays: Mapping[str, NDArray[Any]]) -> Cells:
    return Cells(
        _array(arrays, "cells_w", (4 * said.count, inputs)),
        _array(arrays, "cells_r", (4 * said.count, said.count)),
        _array(arrays, "cells_bias", (4 * said.count,)),
        said.beside,
    )


def _array(arrays: Mapping[str, NDArray[Any]], name: str, shape: tuple[Any, ...]) -> NDArray[np.float32]:
    array = arrays.get(name)
    if array is None or array.dtype != np.float32 or array.shape != shape or 0 in shape:
        got = "none" if array is None else f"{array.dtype} {array.shape}"
        raise ValueError(f"{name} must be float32 of shape {shape}, got {got}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} has numbers that are not finite")
    return array
