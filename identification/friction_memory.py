"""What friction that remembers has kept of the arm's way: one number in [−1, 1], from angles alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant.compiled import compiled

Array = NDArray[np.float64]


def stop(q: Array, travel: float) -> Array:
    """(N,) of a stop element along angles q (N,) [rad]: its deflection over `travel` [rad], at which it slips. It is
    slack at the first angle (Prandtl–Ishlinskii)."""
    out = np.zeros(len(q))
    _stop(np.ascontiguousarray(q), float(travel), out)
    return out


def bristle(q: Array, travel: float) -> Array:
    """The same of a bristle: ż = q̇ − |q̇| z / travel (Dahl), exact where the arm moves one way during a sample."""
    out = np.zeros(len(q))
    _bristle(np.ascontiguousarray(q), float(travel), out)
    return out


@compiled
def _stop(q, travel, out):
    for k in range(1, len(q)):
        out[k] = min(max(out[k - 1] + (q[k] - q[k - 1]) / travel, -1.0), 1.0)


@compiled
def _bristle(q, travel, out):
    for k in range(1, len(q)):
        way = (q[k] - q[k - 1]) / travel
        toward = 1.0 if way > 0.0 else -1.0
        out[k] = toward + (out[k - 1] - toward) * np.exp(-abs(way))
