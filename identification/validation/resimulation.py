"""The closed loop run again on a plant, beside the measurement: a picture, not a statistic.

Feedback hides most errors, so a fit of 98 % is possible with a ten-sigma effect missing. `validation` measures.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import Plant
from furuta_gym.sensors import VELOCITY_CUTOFF, FilteredDifference, Sensors
from furuta_gym.simulation import simulate

from ..logs.log import Log


@dataclass(frozen=True)
class Resimulation:
    """t (N,) [s], simulated readings (N, 2) [rad] and command (N,), and the fit of q1 and q2 to the log (2,) [%].

    Shorter than the log if the simulated pendulum fell.
    """

    t: NDArray[np.float64]
    angles: NDArray[np.float64]
    command: NDArray[np.float64]
    fit_percent: NDArray[np.float64]


def resimulate(plant: Plant, log: Log, velocity_cutoff: float = VELOCITY_CUTOFF) -> Resimulation:
    """Run the log's controller, u = −K x̂ + d, on a plant, with d = u + K x̂ taken from the log.

    x̂ are the readings and their filtered difference (corner [rad/s]), the same on both sides.
    Raises ValueError if the log does not know its controller or has an uneven clock.
    """
    if log.controller_gain is None:
        raise ValueError(
            f"{log.source}: a closed-loop simulation needs the controller: add `# controller_gain: k1 k2 k3 k4` "
            "(of q1, q̇1, q2, q̇2, u = −K x) to the log"
        )
    if not log.regular:
        raise ValueError(f"{log.source}: an uneven clock; use log.resampled() for a closed-loop simulation")
    gain, T = np.asarray(log.controller_gain), log.sample_time
    feedback = _Feedback(gain, T, velocity_cutoff)
    d = log.u - np.array([feedback(y) for y in log.angles])
    feedback.reset()
    m = max(4, round(0.02 / T))
    v = np.polyfit(log.t[:m] - log.t[0], log.angles[:m], 1)[0]
    start = (log.q1[0], log.q2[0], v[0], v[1])
    sensors = Sensors(encoder_counts=log.encoder_counts or 0.0)
    run = simulate(
        plant, feedback, len(log) * T, T, sensors, excitation=d, x0=start, q2_limit=abs(log.q2).max() + np.pi
    )
    n = len(run)
    apart = np.linalg.norm(log.angles[:n] - run.measured, axis=0)
    size = np.linalg.norm(log.angles[:n] - log.angles[:n].mean(axis=0), axis=0)
    return Resimulation(log.t[:n], run.measured, run.command, 100.0 * (1.0 - apart / np.maximum(size, 1e-12)))


class _Feedback:
    """−K x̂ from readings, x̂ by a filtered difference."""

    def __init__(self, gain: NDArray[np.float64], T: float, cutoff: float) -> None:
        self.gain, self.T, self.difference = gain, T, FilteredDifference(cutoff)

    def reset(self) -> None:
        self.difference.reset()

    def __call__(self, y: NDArray[np.float64]) -> float:
        v1, v2 = self.difference.update(float(y[0]), float(y[1]), self.T)
        return -float(self.gain @ [y[0], v1, y[1], v2])
