"""What a run of `experiments.studies.reproduce_paper` is given and what comes out, as values."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import TABLE_3, Plant
from furuta_gym.simulation import Simulation
from identification.least_squares.filtered_model import ParameterHistory
from identification.logs.log import Log


@dataclass(frozen=True)
class Arguments:
    """duration, T [s], encoder_counts per revolution; torque_noise: intensities [V² s] of white torque on both rows.

    lambdas [1/s]: bandwidths of the filter f(s), which the paper does not print; the first one is simulated too.
    """

    seed: int = 0
    duration: float = 20.0
    T: float = 0.001
    encoder_counts: float = 4096
    torque_noise: tuple[float, float] = (1e-6, 1e-8)
    lambdas: tuple[float, ...] = (10.0, 30.0, 100.0)

    @classmethod
    def quick(cls, seed: int = 0) -> Arguments:
        """Small enough for a test."""
        return cls(seed=seed, duration=6.0)


@dataclass(frozen=True)
class Fit:
    """One estimate: theta (9,), its stated standard deviations (9,); plant is None where no plant can have theta.

    flagged: whether the method itself said that it is biased (least squares compares λ with 3λ).
    """

    name: str
    theta: NDArray[np.float64]
    std: NDArray[np.float64]
    plant: Plant | None
    note: str = ""
    flagged: bool = False

    @property
    def error(self) -> NDArray[np.float64]:
        """Relative error against Table 3 (9,)."""
        return self.theta / TABLE_3.theta - 1.0


@dataclass(frozen=True)
class Cause:
    """Relative error (9,) of least squares at λ on a log from which part of the errors was taken out."""

    case: str
    lam: float
    error: NDArray[np.float64]


@dataclass(frozen=True)
class ScaleSignal:
    """Arm's row at λ, rms in V: all errors of its regressors together, and the torque that tells the scale of θ3.

    That torque is θ3's column less what the row's other columns can imitate.
    """

    lam: float
    signal: float
    error: float


@dataclass(frozen=True)
class Results:
    """Everything the figures and the tables show. simulations: by the fit's name, and of the truth for comparison."""

    arguments: Arguments
    log: Log
    experiment: Simulation
    fits: dict[str, Fit]
    histories: dict[str, ParameterHistory]
    simulations: dict[str, Simulation]
    causes: list[Cause]
    scale: list[ScaleSignal]

    def misfit(self, name: str) -> dict[str, float]:
        """Rms difference between a simulation and the experiment, over the time that both last."""
        run = self.simulations[name]
        n = min(len(run), len(self.experiment))
        difference = run.state[:n, :2] - self.experiment.state[:n, :2]
        q1, q2 = np.sqrt(np.mean(difference**2, axis=0))
        command = math.sqrt(np.mean((run.command[:n] - self.experiment.command[:n]) ** 2))
        return {"q1_rad": float(q1), "q2_rad": float(q2), "tau_V": command}
