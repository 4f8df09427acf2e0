"""What a training run has in hand beside what it learned: random streams, the rigs, the last observations.

With `learning_state` it makes a run that is gone on with equal to one that was never stopped.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from furuta_gym.envs.vector import FurutaVectorEnv

from .learning_state import Arrays

_TWISTER = "MT19937"  # numpy's global stream, from which stable-baselines3 shuffles


def running_state(model: Any, batch: FurutaVectorEnv) -> Arrays:
    """Everything by name; between two rollouts, when nothing is half collected."""
    import torch

    kind, key, position, has_gauss, gauss = np.random.get_state()  # noqa: NPY002  (it is what the library uses)
    assert kind == _TWISTER
    found: Arrays = {f"rigs/{name}": value for name, value in batch.snapshot().items()}
    found |= {
        "torch": torch.get_rng_state().numpy().copy(),
        "numpy/key": np.asarray(key).astype(np.int64),
        "numpy/rest": np.array([position, has_gauss, gauss], dtype=float),
        "actions": _words(model.action_space.np_random.bit_generator.state),
        "observation": np.asarray(model._last_obs, dtype=np.float32),
        "starts": np.asarray(model._last_episode_starts, dtype=np.uint8),
        "counts": np.array([model._episode_num, model._n_updates], dtype=np.int64),
    }
    for i, part in enumerate(_cell_states(model)):
        found[f"cells/{i}"] = part.numpy().copy()
    return found


def put_running_state(model: Any, batch: FurutaVectorEnv, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Set all of it. Raises ValueError or KeyError if it does not fit."""
    import torch

    batch.restore({name[5:]: value for name, value in arrays.items() if name.startswith("rigs/")})
    n, size = batch.num_envs, batch.single_observation_space.shape
    shapes = {"observation": (n, *(size or ())), "starts": (n,), "counts": (2,), "numpy/key": (624,)}
    shapes |= {"numpy/rest": (3,), "actions": (6,)}
    cells = {f"cells/{i}": part for i, part in enumerate(_cell_states(model))}
    for name, shape in (shapes | {name: tuple(part.shape) for name, part in cells.items()}).items():
        if arrays[name].shape != shape:
            raise ValueError(f"{name} must have shape {shape}, got {arrays[name].shape}")
    torch.set_rng_state(torch.from_numpy(arrays["torch"]))
    position, has_gauss, gauss = arrays["numpy/rest"].tolist()
    key = arrays["numpy/key"].astype(np.uint32)
    np.random.set_state((_TWISTER, key, int(position), int(has_gauss), gauss))  # noqa: NPY002
    generator = model.action_space.np_random.bit_generator
    generator.state = _from_words(generator.state, arrays["actions"])
    model._last_obs, model._last_episode_starts = arrays["observation"], arrays["starts"].astype(bool)
    if hasattr(model, "_last_original_obs"):
        model._last_original_obs = None
    model._episode_num, model._n_updates = arrays["counts"].tolist()
    for name, part in cells.items():
        part.copy_(torch.from_numpy(arrays[name]))


def _cell_states(model: Any) -> list[Any]:
    """Of a recurrent policy: output and content of the actor's and the critic's cells, as tensors of the model."""
    states = getattr(model, "_last_lstm_states", None)
    return [] if states is None else [*states.pi, *states.vf]


def _words(state: Mapping[str, Any]) -> NDArray[np.int64]:
    """A PCG64's state as six numbers: two of 128 bits in halves, and what is left of a 64-bit draw."""
    inner = state["state"]
    halves = [half for name in ("state", "inc") for half in (inner[name] >> 64, inner[name] & (2**64 - 1))]
    words = np.array([*halves, state["has_uint32"], state["uinteger"]], dtype=np.uint64)
    return words.view(np.int64)


def _from_words(state: Mapping[str, Any], words: NDArray[np.int64]) -> dict[str, Any]:
    high, low, high_inc, low_inc, has, rest = (int(word) for word in words.view(np.uint64))
    inner = {"state": high << 64 | low, "inc": high_inc << 64 | low_inc}
    return dict(state) | {"state": inner, "has_uint32": has, "uinteger": rest}
