"""The learners' environments under ids of their own, which print how each episode ended.

`gymnasium.make("experiments.studies.watched_env:WatchedFurutaSwingUp-v0")` is `FurutaSwingUp-v0` in everything else, so
that a training script can be judged which prints nothing that compares.
"""

from __future__ import annotations

from typing import Any, SupportsFloat

import gymnasium
import numpy as np

from furuta_gym.envs.furuta import FurutaEnv
from furuta_gym.envs.registration import TASK_IDS, options_of

PREFIX = "Watched"
UPRIGHT = 0.2  # rad
HELD = 0.5  # of an episode's length, at its end


class Watched(gymnasium.Wrapper):
    """Prints `watched: step=…, held=0|1` when an episode ends: the steps so far, and whether the pendulum was upright
    within 0.2 rad all through the last half of the time limit."""

    def __init__(self, env: FurutaEnv) -> None:
        super().__init__(env)
        self._steps, self._upright = 0, 0
        self._wanted = round(HELD * env.setup.longest)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        self._upright = 0
        return super().reset(seed=seed, options=options)

    def step(self, action: Any) -> tuple[Any, SupportsFloat, bool, bool, dict[str, Any]]:
        seen, reward, terminated, truncated, info = super().step(action)
        self._steps += 1
        self._upright = self._upright + 1 if np.cos(info["state"][1]) > np.cos(UPRIGHT) else 0
        if terminated or truncated:
            held = truncated and not terminated and self._upright >= self._wanted
            print(f"watched: step={self._steps}, held={int(held)}", flush=True)
        return seen, reward, terminated, truncated, info


def watched(**options: Any) -> Watched:
    """The environment with these options of `FurutaEnv`, watched."""
    return Watched(FurutaEnv(**options))


for _id in TASK_IDS.values():
    if PREFIX + _id not in gymnasium.registry:
        gymnasium.register(id=PREFIX + _id, entry_point=watched, kwargs=options_of(_id))
