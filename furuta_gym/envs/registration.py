"""The names under which Gymnasium knows the environments, their options, and how long an episode lasts."""

import importlib
import math
import os
import warnings
from collections.abc import Mapping
from copy import copy
from enum import Enum
from typing import Any

from gymnasium.envs.registration import EnvSpec, registry, spec
from gymnasium.envs.registration import register as gymnasium_register
from gymnasium.error import Error

from ..arguments import ArgumentError

ENV_ID = "FurutaID-v0"
MAX_EPISODE_STEPS = 1000  # 10 s at the default 100 Hz

_ENTRY = "furuta_gym.envs.furuta:FurutaEnv"
TASK_IDS = {"balance": "FurutaBalance-v0", "swing_up": "FurutaSwingUp-v0"}
# Options of `FurutaEnv` that the two ids set, and that `gymnasium.make` may change.
TASK_OPTIONS: dict[str, Any] = {
    "plant": "qube",
    "normalize_action": True,
    "scale_observation": True,
    "reward": "tolerant",
    # values of at most ten at a discount of 0.99: with a hundred, PPO of stable-baselines3 does not stay where it was
    "reward_scale": 0.1,
    "action_time": 0.02,  # s; a tenth of the fastest motion of such rigs
    # s; a thousand actions, as learners' defaults expect: some give the last state of a truncated episode no value
    "time_limit": 20.0,
}
REWARD_THRESHOLDS = {"balance": 96.0, "swing_up": 95.0}  # of at most 100


def options_of(env_id: str) -> dict[str, Any]:
    """The options that a registered id sets; "module:id" imports the module first, as `gymnasium.make` does.

    Of an id that was registered with our entry point they hold its `max_episode_steps` too. Raises ValueError for
    another id, and for a module that cannot be found."""
    module, _, name = env_id.rpartition(":")
    if module:
        try:
            importlib.import_module(module)
        except ModuleNotFoundError as error:
            raise ValueError(
                f"{env_id!r}: {error}. Expected MODULE:ID with a module that registers {name!r}"
            ) from error
    for task, own in TASK_IDS.items():
        if name == own:
            return {"task": task} | TASK_OPTIONS
    if name == ENV_ID:
        return {}
    try:
        own_id = spec(name)
    except Error:
        own_id = None
    if own_id is not None and _entry_of(own_id) == _ENTRY:
        return {"max_episode_steps": own_id.max_episode_steps} | own_id.kwargs
    known = ", ".join((ENV_ID, *TASK_IDS.values()))
    raise ValueError(f"no environment {env_id!r} here; expected one of {known}, or an id registered with {_ENTRY}")


def _entry_of(own_id: Any) -> str:
    entry = own_id.entry_point
    return entry if isinstance(entry, str) else f"{entry.__module__}:{entry.__qualname__}"


class PlainSpec:
    """The attribute `spec` of an env: Gymnasium's, in which a Plant is its dictionary, a path or a mode its text, and
    an array a list.

    So the spec has a JSON, and `gymnasium.make` of it makes the same env."""

    def __get__(self, env: Any, owner: Any = None) -> EnvSpec | None:
        return None if env is None else env.__dict__.get("spec")

    def __set__(self, env: Any, given: EnvSpec | None) -> None:
        from ..plant.plant import Plant  # here, as registering the ids is to load nothing heavy

        told = {} if given is None else {name: _plainly(value, Plant) for name, value in given.kwargs.items()}
        if given is not None and any(told[name] is not value for name, value in given.kwargs.items()):
            given = copy(given)
            given.kwargs = told
        env.__dict__["spec"] = given
        if given is not None and (doubt := env.setup.doubt):
            warnings.warn(doubt, stacklevel=3)


def _plainly(value: Any, plant: type) -> Any:
    """An argument of an env as JSON can hold it, where it is a Plant, a path, an enumeration or of NumPy."""
    if isinstance(value, plant):
        return value.to_dict()
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, Mapping):
        told = {name: _plainly(part, plant) for name, part in value.items()}
        plain = type(value) is dict and all(told[name] is part for name, part in value.items())
        return value if plain else told
    if hasattr(value, "tolist"):  # an array or a number of NumPy, which registering the ids does not import
        return value.tolist()
    return os.fspath(value) if isinstance(value, os.PathLike) else value


def check_time_limit(spec: Any, actions: float, limit: float | None = None, taken: int = 0) -> None:
    """Say where an episode ends before a `time_limit` of so many actions (inf: none) that the id does not set itself.

    spec: of the env. limit: of a batch, which knows it: then it raises ArgumentError. A single env does not know
    whether `gymnasium.make` was given another limit than its id has. It warns once an episode has been left after
    just that many actions; taken: of the episode that is left.
    """
    registered = None if spec is None else registry.get(spec.id)
    if spec is None or registered is None or registered.kwargs.get("time_limit") is not None:
        return
    ends = registered.max_episode_steps if limit is None else limit
    if ends is None or not ends < actions < math.inf:
        return
    if limit is None:
        if taken == ends:
            warnings.warn(
                f"time_limit of {actions:.0f} actions: {spec.id} ended the episode after {ends:.0f}. Give "
                f"gymnasium.make max_episode_steps={actions:.0f} as well",
                stacklevel=3,
            )
        return
    fault = f"{spec.id} ends an episode after {ends:.0f}"
    hint = f"; give max_episode_steps={actions:.0f} in its place"
    raise ArgumentError("time_limit", f"of {actions:.0f} actions", fault, hint)


def register() -> None:
    """Make the three ids known to Gymnasium; calling it again changes nothing."""
    if ENV_ID not in registry:
        gymnasium_register(
            id=ENV_ID,
            entry_point=_ENTRY,
            vector_entry_point="furuta_gym.envs.vector:FurutaVectorEnv",
            max_episode_steps=MAX_EPISODE_STEPS,
        )
    for task, env_id in TASK_IDS.items():
        if env_id not in registry:
            gymnasium_register(
                id=env_id,
                entry_point=_ENTRY,
                vector_entry_point="furuta_gym.envs.vector:FurutaVectorEnv",
                reward_threshold=REWARD_THRESHOLDS[task],
                kwargs=options_of(env_id),
            )
