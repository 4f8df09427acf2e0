"""What a policy can do while it learns, and how far ranges reach: narrow at first, wider with each success."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from furuta_gym.envs.vector import FurutaVectorEnv

from ..comparison.statistics import success_rate
from ..comparison.trials import HOLD, UPRIGHT
from ..learned.layers import Network

WORST = 0.05  # share of the episodes


@dataclass(frozen=True)
class Evaluation:
    """How a policy did at so many env steps, on rigs of level `level` (see `Randomization.narrowed`).

    mean, worst: return of all episodes, and of the worst 5 % of them. success: share of the episodes that kept the arm
    and the pendulum within limits and, in swing-up, held the last 5 s within 0.2 rad of upright.
    """

    steps: int
    level: float
    mean: float
    worst: float
    success: float

    def to_dict(self) -> dict[str, float | int]:
        return asdict(self)


@dataclass(frozen=True)
class Curriculum:
    """Ranges begin at level `first` and widen by `step` when the last `evaluations` at a level had a mean success of
    `threshold` or more. Raises ValueError for numbers that cannot be."""

    threshold: float = 0.9
    first: float = 0.2
    step: float = 0.2
    evaluations: int = 2

    def __post_init__(self) -> None:
        if not (0.0 < self.threshold <= 1.0 and 0.0 <= self.first <= 1.0 and 0.0 < self.step <= 1.0):
            raise ValueError(
                "a curriculum's threshold and step must lie in (0, 1] and its first level in [0, 1], got "
                f"{self.threshold:g}, {self.step:g}, {self.first:g}"
            )
        if self.evaluations < 1:
            raise ValueError(f"a curriculum needs at least 1 evaluation a level, got {self.evaluations}")

    def level(self, past: Sequence[Evaluation]) -> float:
        """Level of the episodes that follow the evaluations `past`; it follows from them alone."""
        if not past:
            return self.first
        level = past[-1].level
        last = [e.success for e in past[-self.evaluations :] if e.level == level]
        if len(last) == self.evaluations and float(np.mean(last)) >= self.threshold:
            return min(1.0, round(level + self.step, 9))
        return level


def reached(curriculum: Curriculum | None, past: Sequence[Evaluation]) -> float:
    """The present level; 1 without a curriculum."""
    return 1.0 if curriculum is None else curriculum.level(past)


def play(act: Any, batch: FurutaVectorEnv, seed: int, level: float) -> tuple[np.ndarray, np.ndarray]:
    """(returns, successes) of one episode of each env of a batch, started from `seed` at `level`.

    act: observations (N, n) to actions (N, 1); what it remembers is of no episode yet. Episodes must be truncated, or
    this does not end.
    """
    batch.set_level(level)
    observation, _ = batch.reset(seed=seed)
    n, setup = batch.num_envs, batch.setup
    total, going, fell = np.zeros(n), np.ones(n, dtype=bool), np.zeros(n, dtype=bool)
    down, steps = np.zeros(n), np.zeros(n)
    while going.any():
        observation, reward, terminated, truncated, info = batch.step(act(observation))
        total += np.where(going, reward, 0.0)
        steps += going
        q2 = info["state"][:, 1]
        leaning = np.abs(q2 - 2 * np.pi * np.round(q2 / (2 * np.pi))) > UPRIGHT
        down = np.where(going & leaning, steps, down)
        fell |= going & terminated
        going &= ~(terminated | truncated)
    success = ~fell
    if setup.options.task == "swing_up":
        success &= (steps - down) * setup.action_period >= HOLD - 1e-9
    return total, success


def evaluation(network: Network, batch: FurutaVectorEnv, seed: int, steps: int, level: float) -> Evaluation:
    """`play`, summed up."""
    total, success = play(network.begin(), batch, seed, level)
    count = max(1, round(WORST * total.size))
    return Evaluation(steps, level, float(total.mean()), float(np.sort(total)[:count].mean()), float(success.mean()))


def on_drawn_rigs(network: Network, batch: FurutaVectorEnv, seed: int) -> dict[str, Any]:
    """For the record: success with its interval, and the returns, on rigs drawn from the whole ranges."""
    total, success = play(network.begin(), batch, seed, 1.0)
    count = max(1, round(WORST * total.size))
    mean, worst = float(total.mean()), float(np.sort(total)[:count].mean())
    return {"episodes": total.size, "success": success_rate(success).to_dict(), "return": mean, "worst_return": worst}
