"""Gaps of a log's clock: where samples were dropped, and not only late."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

_REGULAR, _UNEVEN = 1.5, 2.5
_COARSE = 0.05  # of a spacing; a finer rounding does no harm
_FEWEST_LONGER = 10  # spacings of each of two kinds
_NOTHING = 1e-3  # of a digit: rounding of stamps that are kept in binary
_LOST = 0.1  # share of double spacings, below which samples are lost at regular intervals
_ONE_DIGIT = 1.05  # which rounded stamps scatter about a line at most
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


def evened(t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Stamps t [s] of an even clock that were rounded coarsely, as those of a loop at 800 Hz to milliseconds, without
    the rounding; any other stamps as they are.

    Rounded stamps lie within half a digit of a line, and have two spacings that differ by a digit. An even clock that
    lost some samples has two spacings as well, and does not keep to a line.
    """
    steps = np.diff(t)
    if steps.size < 2 * _FEWEST_LONGER or not np.all(steps > 0.0):
        return t
    low, digit = float(steps.min()), float(np.ptp(steps))
    if not _COARSE * low < digit < low * (1.0 + _NOTHING):
        return t
    longer = (steps - low) / digit
    whole = np.round(longer)
    if np.abs(longer - whole).max() > _NOTHING or not _FEWEST_LONGER <= whole.sum() <= whole.size - _FEWEST_LONGER:
        return t
    if digit > low * (1.0 - _NOTHING) and whole.mean() < _LOST:  # a logger that pauses for a sample now and then
        return t
    k = np.arange(t.size)
    slope, start = np.polyfit(k, t, 1)
    return start + slope * k if np.ptp(t - slope * k) < _ONE_DIGIT * digit else t


def gaps(t: ArrayLike) -> NDArray[np.bool_]:
    """Of each spacing of stamps t [s], whether samples were dropped in it."""
    return np.diff(np.asarray(t, dtype=float)) > longest_spacing(t)
