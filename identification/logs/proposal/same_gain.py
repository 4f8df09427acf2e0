"""Whether the command does the same in two logs: one set of the arm's numbers for both, and a factor between them.

The arm's row of model (5) is linear in θ. So is the command in it, which a changed supply or another driver multiplies.
Each log alone gives these numbers too roughly to be compared: upright, q̈1 and q̈2 cos q2 go together, and their two
coefficients trade for one another. Both logs together leave only the factor to differ.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..signs import Smoothed

Array = NDArray[np.float64]

_NEAR = np.linspace(-np.log(5.0), np.log(5.0), 323)  # logarithms of factors, in steps of a per cent
_FAR = np.linspace(np.log(5.0), np.log(1e5), 200)  # a command in another unit, as volts beside millivolts
_TRIED = np.exp(np.concatenate([-_FAR, _NEAR, _FAR]))
_RESTS = 0.01  # rad/s, below which dry friction turns over


@dataclass(frozen=True)
class Driven:
    """Of one log the normal equations of the arm's row: gram (6, 6), right (6,), for a command of length one.

    What each log has of its own, an offset of the command and the place where a cable rests, is taken out before.
    """

    gram: Array
    right: Array

    @classmethod
    def of(cls, arm: Smoothed, pendulum: Smoothed, command: Array) -> Driven | None:
        """From angles in rad and the command, smoothed alike; None where the command does not change."""
        sin, cos = np.sin(pendulum.q), np.cos(pendulum.q)
        turning = arm.a * sin**2 + 2.0 * arm.v * pendulum.v * sin * cos
        friction = arm.v, np.tanh(arm.v / _RESTS)
        shared = np.column_stack([arm.a, pendulum.a * cos, pendulum.v**2 * sin, turning, *friction])
        own, _ = np.linalg.qr(np.column_stack([np.ones_like(arm.q), arm.q - arm.q.mean()]))
        X, u = (x - own @ (own.T @ x) for x in (shared, np.asarray(command, dtype=float)))
        length = float(np.linalg.norm(u))
        if not length > 1e-9 * float(np.linalg.norm(command)):
            return None
        return cls(X.T @ X / length**2, X.T @ u / length**2)


@dataclass(frozen=True)
class Gains:
    """factor: by which the second log's command does more than the first's. unexplained: share of the square of the
    commands that one set of numbers leaves with this factor, and with_one: without a factor."""

    factor: float
    unexplained: float
    with_one: float


def gains(first: Driven, second: Driven) -> Gains:
    """The factor between two logs with which one set of the arm's numbers explains both best."""
    left = np.array([_left(first, second, factor) for factor in _TRIED])
    best = int(np.argmin(left))
    return Gains(float(_TRIED[best]), float(left[best]), _left(first, second, 1.0))


def _left(first: Driven, second: Driven, factor: float) -> float:
    """Share of the two commands' squares that is left; the second's numbers are the first's over the factor."""
    gram = first.gram + second.gram / factor**2
    right = first.right + second.right / factor
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    solved, *_ = np.linalg.lstsq(gram / np.outer(scale, scale), right / scale, rcond=1e-9)
    return 1.0 - 0.5 * float(solved @ (right / scale))
