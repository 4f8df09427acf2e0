"""A log as the Kalman filter takes it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .logs import Log


@dataclass(frozen=True)
class Record:
    """t (N,) from zero [s], y (N, 2) readings [rad], u (N, 1) commands, held from their sample on.

    variance (2,): of a reading [rad²], and weight (N, 2): factors on it (see `dwell_weights`). velocity (2,) and
    velocity_std: of the first state [rad/s].
    """

    t: NDArray[np.float64]
    y: NDArray[np.float64]
    u: NDArray[np.float64]
    variance: NDArray[np.float64]
    weight: NDArray[np.float64]
    velocity: NDArray[np.float64]
    velocity_std: float

    @classmethod
    def from_log(cls, log: Log) -> Record:
        """Variances from the encoder's counts where known, not below a quarter of the noise that the log shows."""
        counts = np.asarray(log.encoder_counts or (0.0, 0.0))
        quantum = np.divide(2 * np.pi, counts, out=np.zeros(2), where=counts > 0)
        measured = np.asarray(log.noise_std)
        variance = np.maximum(np.maximum(quantum**2 / 12.0, 0.25 * measured**2), 1e-14)
        return cls.from_arrays(log.t - log.t[0], log.angles, log.u, variance)

    @classmethod
    def from_arrays(cls, t: ArrayLike, y: ArrayLike, u: ArrayLike, variance: ArrayLike) -> Record:
        """t (N,), y (N, 2), u (N,), reading variances (2,); the first velocity comes from the first readings."""
        t, y, variance = np.array(t, dtype=float), np.array(y, dtype=float), np.array(variance, dtype=float)
        t -= t[0]
        m = min(len(t), max(6, int(np.searchsorted(t, 0.02))))
        slope = np.polyfit(t[:m], y[:m], 1 if m < 12 else 2)[-2]
        spread = 3.0 * math.sqrt(12.0 * variance.max() / m) / max(t[m - 1], 1e-6)
        return cls(t, y, np.array(u, dtype=float).reshape(-1, 1), variance, dwell_weights(y), slope, 0.1 + spread)


def dwell_weights(y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Factors (N, 2) on the variance of readings y (N, 2): half the length of the run of equal readings each is in.

    Rounding errors are white only where the angle moves by a count or more a sample. While a count repeats, its
    error goes on, and taking every repetition for news lets the filter explain it by torques that are not there
    (with 2048 counts at 1 ms the torque noise came out 100 times too large, and the parameters several standard
    deviations off). So a dwell of n equal readings counts as two, whatever its length.
    """
    weight = np.ones_like(y)
    for axis in range(y.shape[1]):
        edges = [0, *(np.flatnonzero(np.diff(y[:, axis])) + 1), len(y)]
        for start, stop in pairwise(edges):
            weight[start:stop, axis] = max(1.0, 0.5 * (stop - start))
    return weight
