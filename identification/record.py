"""A log as the Kalman filter takes it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .logs import Log

_SAME_STEP = 0.1  # an encoder step that the samples show differs from the declared one beyond this fraction


@dataclass(frozen=True)
class Record:
    """t (N,) from zero [s], y (N, 2) readings [rad], u (N, 1) commands, held from their sample on.

    quantum (2,): one count of each encoder [rad], 0 where the reading is not rounded. variance (2,): of a reading
    taken as noise, rounding included [rad²]. velocity (2,) and velocity_std: of the first state [rad/s].
    """

    t: NDArray[np.float64]
    y: NDArray[np.float64]
    u: NDArray[np.float64]
    quantum: NDArray[np.float64]
    variance: NDArray[np.float64]
    velocity: NDArray[np.float64]
    velocity_std: float

    @classmethod
    def from_log(cls, log: Log) -> Record:
        """Counts as declared, or as the samples show them; noise not below a quarter of what the log shows."""
        declared = [2 * math.pi / c if c > 0 else 0.0 for c in log.encoder_counts or (0.0, 0.0)]
        quantum = np.array([_step(seen, known) for seen, known in zip(log.encoder_steps, declared, strict=True)])
        measured = np.asarray(log.noise_std)
        variance = np.maximum(np.maximum(quantum**2 / 12.0, 0.25 * measured**2), 1e-14)
        return cls.from_arrays(log.t, log.angles, log.u, variance, quantum)

    @classmethod
    def from_arrays(
        cls, t: ArrayLike, y: ArrayLike, u: ArrayLike, variance: ArrayLike, quantum: ArrayLike = (0.0, 0.0)
    ) -> Record:
        """t (N,), y (N, 2), u (N,), variance and quantum (2,); the first velocity comes from the first readings."""
        stamps, readings = np.array(t, dtype=float), np.array(y, dtype=float)
        stamps -= stamps[0]
        m = min(len(stamps), max(6, int(np.searchsorted(stamps, 0.02))))
        slope = np.polyfit(stamps[:m], readings[:m], 1 if m < 12 else 2)[-2]
        spread = 3.0 * math.sqrt(12.0 * float(np.max(variance)) / m) / max(stamps[m - 1], 1e-6)
        commands = np.array(u, dtype=float).reshape(-1, 1)
        known = np.array(quantum, dtype=float), np.array(variance, dtype=float)
        return cls(stamps, readings, commands, *known, slope, 0.1 + spread)


def _step(seen: float | None, declared: float) -> float:
    """The encoder's step that counts: the samples' own where it contradicts the declared one."""
    return seen if seen is not None and abs(seen - declared) > _SAME_STEP * seen else declared
