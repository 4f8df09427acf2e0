"""What stable-baselines3 is given besides the env: scaled observations and rewards, and callbacks."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper


class ScaledObservation(BaseFeaturesExtractor):
    """First layer of a policy: multiplies each entry of the observation by a fixed number.

    The scale follows from the plant (`recipes.observation_scale`) and lies in the policy file as a buffer: there are
    no running statistics that could be lost, drift, or differ between training and rig.
    """

    scale: torch.Tensor

    def __init__(self, observation_space: spaces.Box, scale: Sequence[float]) -> None:
        n = observation_space.shape[0]
        if len(scale) != n:
            raise ValueError(f"the observation has {n} entries and the scale {len(scale)}")
        super().__init__(observation_space, n)
        self.register_buffer("scale", torch.tensor(scale, dtype=torch.float32))

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        return observations * self.scale


class ScaledReward(VecEnvWrapper):
    """Multiplies rewards by a constant: a critic learns returns of about ten faster than returns of a hundred."""

    def __init__(self, venv: VecEnv, scale: float) -> None:
        super().__init__(venv)
        self.scale = scale

    def reset(self) -> Any:
        return self.venv.reset()

    def step_wait(self) -> tuple[Any, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        observations, rewards, dones, infos = self.venv.step_wait()
        return observations, self.scale * rewards, dones, infos


class Report(BaseCallback):
    """Calls tell(env steps so far, of how many) after each step of the batch."""

    def __init__(self, tell: Callable[[int, int], None], steps: int) -> None:
        super().__init__()
        self.tell, self.steps = tell, steps

    def _on_step(self) -> bool:
        self.tell(min(self.num_timesteps, self.steps), self.steps)
        return True


class EveryNow(BaseCallback):
    """Calls `do` about every `steps` env steps, and at the end: between two rollouts, when no step is half learned."""

    def __init__(self, do: Callable[[], None], steps: int) -> None:
        super().__init__()
        self.do, self.steps = do, steps

    def _on_training_start(self) -> None:
        self.done_at = self.num_timesteps

    def _on_rollout_start(self) -> None:
        if self.model.num_timesteps // self.steps > self.done_at // self.steps:
            self._do()

    def _on_training_end(self) -> None:
        if self.model.num_timesteps > self.done_at:
            self._do()

    def _do(self) -> None:
        self.done_at = self.model.num_timesteps
        self.do()

    def _on_step(self) -> bool:
        return True
