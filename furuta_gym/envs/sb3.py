"""The compiled batch as a stable-baselines3 `VecEnv`, so that PPO, SAC and others train on it in one process."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.vec_env.base_vec_env import VecEnv

from .furuta import start_state
from .registration import ENV_ID, options_of
from .vector import FurutaVectorEnv


def _of_env(info: Mapping[str, Any], i: int) -> dict[str, Any]:
    """Of a batch's info what one environment has."""
    found: dict[str, Any] = {}
    for name, values in info.items():
        if name.startswith("_") or name.startswith("final_"):
            continue
        own = _of_env(values, i) if isinstance(values, Mapping) else values[i]
        found[name] = own.copy() if isinstance(own, np.ndarray) else own
    return found


class FurutaVecEnv(VecEnv):
    """`FurutaVectorEnv` for stable-baselines3: the registered `env_id`, with its options, and any others.

    The defaults are those of `gymnasium.make(env_id)`; env_id may be "module:id". A `time_limit` that is given takes
    the place of the id's `max_episode_steps`, also where it is longer. Gaussian policies of stable-baselines3 start
    with a spread of one, so for `FurutaID-v0` give `normalize_action=True`; the other ids have it. Wrap it in
    `VecMonitor` for episode returns.

    Where an episode ends, its info holds `terminal_observation`, `TimeLimit.truncated` (True only if it did not also
    terminate), and the last `state`, `measured_state` and `command`. `reset_infos` has those of the new episode, and
    the `plant` and `rig` that were drawn for it. Within an episode info is empty; `last_info` has the arrays of the
    last step or reset.
    """

    def __init__(self, num_envs: int = 16, env_id: str = ENV_ID, **options: Any) -> None:
        own = options_of(env_id)
        if "time_limit" in options:
            own.pop("max_episode_steps", None)
        options = own | options
        self.batch = FurutaVectorEnv(num_envs, autoreset_mode=AutoresetMode.SAME_STEP, **options)
        super().__init__(self.batch.num_envs, self.batch.single_observation_space, self.batch.single_action_space)
        self.metadata |= {"render_fps": self.batch.metadata["render_fps"]}
        self.last_info: dict[str, Any] = {}
        self._actions: Any = None

    def reset(self) -> np.ndarray:
        seeds = None if all(seed is None for seed in self._seeds) else self._seeds
        state = np.array([start_state(options, self.batch.setup) for options in self._options])
        observations, self.last_info = self.batch.reset(seed=seeds, options={"state": state})
        self.reset_infos = [_of_env(self.last_info, i) for i in range(self.num_envs)]
        self._reset_seeds()
        self._reset_options()
        return observations

    def step_async(self, actions: np.ndarray) -> None:
        self._actions = actions

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        observations, rewards, terminated, truncated, info = self.batch.step(self._actions)
        self.last_info = info
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        dones = terminated | truncated
        for i in np.flatnonzero(dones):
            infos[i] = _of_env(info["final_info"], int(i))
            infos[i]["terminal_observation"] = info["final_obs"][i]
            self.reset_infos[i] = _of_env(info, int(i))
            infos[i]["TimeLimit.truncated"] = bool(truncated[i] and not terminated[i])
        return observations, rewards.astype(np.float32), dones, infos

    def close(self) -> None:
        self.batch.close()

    def get_images(self) -> Sequence[np.ndarray | None]:
        return self.batch.render() or [None] * self.num_envs

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """The attribute of each env asked for: its own spaces and plant, else what the batch has for all."""
        asked = list(self._get_indices(indices))
        if attr_name == "plant":
            return list(self.batch.plants(asked))
        shared = {"observation_space": self.observation_space, "action_space": self.action_space}
        return [shared[attr_name] if attr_name in shared else getattr(self.batch, attr_name) for _ in asked]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        raise NotImplementedError("the envs of a compiled batch share their options; make a new FurutaVecEnv instead")

    def set_level(self, level: float) -> None:
        """For a curriculum; see `FurutaVectorEnv.set_level`."""
        self.batch.set_level(level)

    def env_method(self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any) -> list[Any]:
        """`set_level` of the whole batch, as VecEnv wrappers pass it on. Raises NotImplementedError for the rest."""
        if method_name == "set_level" and indices is None:
            self.set_level(*method_args, **method_kwargs)
            return [None] * self.num_envs
        raise NotImplementedError(f"a compiled batch has no separate envs to call {method_name!r} on; use `batch`")

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        return [False for _ in self._get_indices(indices)]
