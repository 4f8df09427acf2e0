"""Recordings whose truth is known: the paper's closed loop and a hanging pendulum, from the project's simulator."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from furuta_gym.plant import PAPER_GAIN, TABLE_3, Plant
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import simulate
from identification.design.signals import paper_signal
from identification.logs.log import Log


class PaperPolicy:
    """u = −K (q, q̇) with velocities by a filtered difference (pole 100 rad/s), as a rig would have them."""

    def __init__(self, T: float):
        self.T, self.a = T, float(np.exp(-100 * T))
        self.reset()

    def reset(self) -> None:
        self.last, self.v = None, np.zeros(2)

    def __call__(self, y: np.ndarray) -> float:
        if self.last is not None:
            self.v = self.a * self.v + (1 - self.a) * (y - self.last) / self.T
        self.last = y.copy()
        return float(-np.dot(PAPER_GAIN, [y[0], self.v[0], y[1], self.v[1]]))


@lru_cache
def paper_log(
    T: float = 0.002, duration: float = 10.0, counts: int | None = 4096, plant: Plant = TABLE_3, seed: int = 0
):
    """(Log, true states) of the paper's experiment on a plant; counts None for perfect sensors."""
    run = simulate(
        plant,
        PaperPolicy(T),
        duration,
        T,
        Sensors(encoder_counts=counts),
        excitation=paper_signal(tuple(np.random.default_rng(seed).uniform(size=3))),
        seed=seed,
        longest_step=2.5e-4,
    )
    log = Log(
        run.t,
        run.measured[:, 0],
        run.measured[:, 1],
        run.command,
        input_unit=plant.unit,
        encoder_counts=None if counts is None else (counts, counts),
        source="simulated",
    )
    return log, run.state
