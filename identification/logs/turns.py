"""A column of a wrapped angle whose unit is not known yet."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_TURNS = (2.0 * np.pi, 360.0, 1.0)  # in the usual units
_ROUNDED = 1e-3  # of a turn, by which decimals may widen it
_WHOLE_TURN = 0.9  # of a turn, spanned by an angle that was wrapped


def continuous(values: Array, counts: tuple[float, ...] = ()) -> Array:
    """A column without the jumps of a wrapped angle, whose unit need not be known: a turn in a usual one or `counts`.

    A column that holds less or more than a turn, or whose steps are large without the jumps too, is left as it is.
    """
    steps = np.abs(np.diff(values))
    span = float(np.ptp(values)) if len(values) else 0.0
    if not np.any(steps > 0.5 * span):
        return values
    for turn in (*_TURNS, *counts):
        if _WHOLE_TURN * turn < span <= turn * (1.0 + _ROUNDED):
            unwrapped = np.asarray(np.unwrap(values, period=turn))
            if np.max(np.abs(np.diff(unwrapped))) < turn / 4.0:
                return unwrapped
    return values
