"""All that a stable-baselines3 model goes on learning from, as named arrays: networks, optimisers, memory of steps.

Names: "policy/<parameter>", "<optimiser>/<index of the parameter>/<moment>", "variable/<name>".
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

Arrays = dict[str, NDArray[Any]]

_MEMORY = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")


def parameters_of(model: Any) -> Arrays:
    """Copies of everything that learning changes, the memory of steps apart."""
    found: Arrays = {}
    for name, state in model.get_parameters().items():
        entries = state.items() if "state" not in state else _moments(state["state"])
        found |= {f"{name}/{key}": _array(value) for key, value in entries}
    for name in model._get_torch_save_params()[1]:
        found[f"variable/{name}"] = _array(getattr(model, name))
    return found


def put_parameters(model: Any, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Set a model, made by the same settings, to what `parameters_of` gave. Raises ValueError if it does not fit."""
    import torch

    given = {name: torch.from_numpy(np.array(value)) for name, value in arrays.items()}
    new: dict[str, Any] = {}
    for name, own in model.get_parameters().items():
        mine = {key[len(name) + 1 :]: given.pop(key) for key in list(given) if key.startswith(f"{name}/")}
        new[name] = own | {"state": _state(name, model, mine)} if "state" in own else _fitting(name, own, mine)
    for name in model._get_torch_save_params()[1]:
        variable = getattr(model, name)
        value = _fitting("variable", {name: variable}, {name: given.pop(f"variable/{name}", None)})[name]
        with torch.no_grad():
            variable.copy_(value)
    if given:
        raise ValueError(f"{next(iter(given))!r} is nothing that this algorithm learns")
    model.set_parameters(new, device="cpu")


def memory_of(model: Any) -> Arrays:
    """The steps that an off-policy algorithm remembers, as far as they are filled."""
    memory = model.replay_buffer
    filled = memory.buffer_size if memory.full else memory.pos
    return {name: getattr(memory, name)[:filled].copy() for name in _MEMORY} | {"position": np.array([memory.pos])}


def put_memory(model: Any, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Fill a model's memory with what `memory_of` gave. Raises ValueError if it does not fit."""
    memory = model.replay_buffer
    if set(arrays) != {*_MEMORY, "position"} or arrays["position"].shape != (1,):
        raise ValueError(f"the memory must hold {', '.join(_MEMORY)} and position, got {', '.join(arrays)}")
    filled, position = len(arrays["rewards"]), int(arrays["position"][0])
    full = filled == memory.buffer_size
    if filled > memory.buffer_size or not (0 <= position < filled if full else position == filled):
        raise ValueError(f"a memory of {memory.buffer_size} steps cannot hold {filled} up to number {position}")
    for name in _MEMORY:
        own, given = getattr(memory, name), arrays[name]
        if given.dtype != own.dtype or given.shape != (filled, *own.shape[1:]):
            raise ValueError(
                f"the memory's {name} are {given.dtype} {given.shape}, expected {own.dtype} {own.shape[1:]} a step"
            )
        own[:filled] = given
    memory.pos, memory.full = position, full


def _array(value: Any) -> NDArray[Any]:
    return np.array(value.detach().numpy())


def _moments(state: Mapping[int, Mapping[str, Any]]) -> list[tuple[str, Any]]:
    return [(f"{index}/{key}", value) for index, entry in state.items() for key, value in entry.items()]


def _fitting(name: str, own: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Every own entry as given, of the same shape and type."""
    if set(own) != set(given):
        raise ValueError(f"{name} has {', '.join(sorted(own))}; the file has {', '.join(sorted(given)) or 'nothing'}")
    for key, value in own.items():
        other = given[key]
        if other is None or other.shape != value.shape or other.dtype != value.dtype:
            raise ValueError(f"{name}/{key} is of shape {tuple(value.shape)}; the file has another, or none")
    return dict(given)


def _state(name: str, model: Any, given: Mapping[str, Any]) -> dict[int, dict[str, Any]]:
    """Adam's moments by the index of the parameter that they belong to."""
    optimiser: Any = reduce(getattr, name.split("."), model)
    parameters = [p for group in optimiser.param_groups for p in group["params"]]
    state: dict[int, dict[str, Any]] = {}
    for key, value in given.items():
        index, _, moment = key.partition("/")
        known = moment in ("step", "exp_avg", "exp_avg_sq") and index.isdecimal() and int(index) < len(parameters)
        shape = () if moment == "step" else parameters[int(index)].shape if known else None
        if not known or tuple(value.shape) != tuple(shape):  # type: ignore[arg-type]
            raise ValueError(f"{name}/{key} fits no parameter of this algorithm")
        state.setdefault(int(index), {})[moment] = value
    if any(len(entry) != 3 for entry in state.values()):
        raise ValueError(f"{name}: the moments of some parameters are not complete")
    return state
