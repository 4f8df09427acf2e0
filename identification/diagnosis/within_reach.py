"""Whether the arm of held-out logs is where the fitted logs had it.

What depends on the arm's angle, as a cable does, is known only where the arm has been. Further out its law is an
extrapolation: an error there says nothing about whether the effect acts.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..kalman.coordinates import Zeros
from ..logs.log import Log

Array = NDArray[np.float64]


def arm_angles(logs: Sequence[Log], zeros: Zeros) -> Array:
    """The arm's angles (N,) [rad] in all logs, its zero in each taken off."""
    return np.concatenate([log.angles[:, 0] - zeros.get(i, (0.0, 0.0))[0] for i, log in enumerate(logs)])


def share_beyond(angles: Array, low: float, high: float) -> float:
    """Share of angles (N,) that lie outside of low to high [rad]."""
    return float(np.mean((angles < low) | (angles > high)))
