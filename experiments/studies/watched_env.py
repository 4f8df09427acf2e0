"""The learners' environments under ids of their own, which print how a training script does in them.

`gymnasium.make("experiments.studies.watched_env:WatchedFurutaSwingUp-v0")` is `FurutaSwingUp-v0` in everything else, so
that a training script can be judged which prints nothing that compares.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Mapping
from typing import Any, SupportsFloat

import gymnasium
import numpy as np

from experiments.studies.mean_action import mean_policy
from experiments.studies.sb3_defaults import success
from furuta_gym.envs.furuta import FurutaEnv
from furuta_gym.envs.registration import TASK_IDS, options_of

PREFIX = "Watched"
EVERY = "FURUTA_JUDGED_EVERY"  # environment variable: steps of the script from one judgement to the next
OPTIONS = "FURUTA_WATCHED_OPTIONS"  # environment variable: options of the environment that are changed, as JSON
UPRIGHT = 0.2  # rad
HELD = 0.5  # of an episode's length, at its end


class Watched(gymnasium.Wrapper):
    """Prints how episodes end, and how many starts the script's mean action brings up.

    `watched: step=…, held=0|1` when an episode ends: the steps so far, and whether the pendulum was upright within
    0.2 rad all through the last half of the time limit. `judged: step=…, success=…, cpu_s=…` every so many steps of the
    script and at its end, by the first of its environments: see `mean_action` and `sb3_defaults.success`.
    """

    def __init__(self, env: FurutaEnv, options: Mapping[str, Any]) -> None:
        super().__init__(env)
        self._options = options
        self._steps, self._upright, self._judged = 0, 0, 0
        self._wanted = round(HELD * env.setup.longest)
        self._every = int(os.environ.get(EVERY, "0"))
        self._envs: int | None = None  # of the script; not known before its first step, 0 where nothing can be judged

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
        self._judge(last=False)
        return seen, reward, terminated, truncated, info

    def close(self) -> None:
        """End of the script: what it has learned in all is judged too."""
        self._judge(last=True)
        super().close()

    def _judge(self, last: bool) -> None:
        if not self._every or self._envs == 0:
            return
        if self._envs is None:
            with mean_policy(self) as found:
                self._envs = 0 if found is None else found[1]
        due = self._steps * self._envs // self._every
        if self._steps and (due > self._judged or last):
            self._judged = due
            self._print_success(self._steps * self._envs)

    def _print_success(self, steps: int) -> None:
        began = time.process_time()
        with mean_policy(self) as found:
            if found is not None:
                rate = success(found[0], TASK_IDS[self._options["task"]], **self._options)
                spent = time.process_time() - began
                print(f"judged: step={steps}, success={rate:.4f}, cpu_s={spent:.2f}", flush=True)


def watched(**options: Any) -> Watched:
    """The environment with these options of `FurutaEnv`, or those that `OPTIONS` says, watched."""
    options |= json.loads(os.environ.get(OPTIONS, "{}"))
    return Watched(FurutaEnv(**options), {name: x for name, x in options.items() if name != "render_mode"})


for _id in TASK_IDS.values():
    if PREFIX + _id not in gymnasium.registry:
        gymnasium.register(id=PREFIX + _id, entry_point=watched, kwargs=options_of(_id))
