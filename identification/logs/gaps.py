"""Gaps of a log's clock: where samples were dropped, and not only late."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

_REGULAR, _UNEVEN = 1.5, 2.5
_SCATTERS = 5.0  # robust standard deviations of a spacing, beyond which it is no late sample


def longest_spacing(t: ArrayLike) -> float:
    """The spacing of stamps t [s] beyond which samples count as dropped [s].

    It is 1.5 median spacings of a regular clock, and up to 2.5 of one whose stamps scatter: late samples are no gap.
    Infinite where most stamps repeat the one before.
    """
    steps = np.diff(np.asarray(t, dtype=float))
    typical = float(np.median(steps))
    if not typical > 0.0:  # stamps of too few digits, which is said elsewhere
        return math.inf
    scatter = 1.4826 * float(np.median(np.abs(steps - typical))) / typical
    return typical * float(np.clip(1.0 + _SCATTERS * scatter, _REGULAR, _UNEVEN))


def gaps(t: ArrayLike) -> NDArray[np.bool_]:
    """Of each spacing of stamps t [s], whether samples were dropped in it."""
    return np.diff(np.asarray(t, dtype=float)) > longest_spacing(t)
