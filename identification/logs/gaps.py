"""Gaps of a log's clock: where samples were dropped, and not only late."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

_REGULAR, _UNEVEN = 1.5, 2.5
_COARSE = 0.05  # of a spacing; a finer rounding does no harm
_FEWEST_LONGER = 10  # spacings of each of two kinds
_MOST_LOST = 0.1  # share of spacings in which samples are lost; with more, no line can be told
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

    Rounded stamps lie within half a digit of a line, and have two spacings that differ by a digit. Where samples were
    lost between them, each part lies on a line of the same slope. An even clock that lost samples has two spacings as
    well, and its parts have one.
    """
    steps = np.diff(t)
    if steps.size < 2 * _FEWEST_LONGER or not np.all(steps > 0.0):
        return t
    low = float(steps.min())
    longer = steps[steps > low * (1.0 + _COARSE)]
    digit = float(longer.min()) - low if longer.size else 0.0
    if not 0.0 < digit < low * (1.0 + _NOTHING):
        return t
    whole = np.round((steps - low) / digit)
    if np.abs(steps - low - whole * digit).max() > _NOTHING * digit:
        return t
    rounded, share = whole < 2, float(np.mean(whole == 1))
    if not _FEWEST_LONGER <= np.sum(whole == 1) <= steps.size - _FEWEST_LONGER or np.mean(~rounded) > _MOST_LOST:
        return t
    if digit > low * (1.0 - _NOTHING) and share < _LOST:  # a logger that pauses for a sample now and then
        return t
    part = np.concatenate([[0], np.cumsum(~rounded)])
    number = np.bincount(part)
    first = np.concatenate([[0], np.cumsum(number)[:-1]])
    k = np.arange(t.size) - first[part]
    mean_k, mean_t = np.bincount(part, k) / number, np.bincount(part, t) / number
    from_mean = k - mean_k[part]
    slope = float(from_mean @ (t - mean_t[part]) / (from_mean @ from_mean))
    even = mean_t[part] + slope * from_mean
    # each part's own scatter about the common slope
    off = t - even
    scatter = np.maximum.reduceat(off, first) - np.minimum.reduceat(off, first)
    return even if scatter.max() < _ONE_DIGIT * digit else t


def gaps(t: ArrayLike) -> NDArray[np.bool_]:
    """Of each spacing of stamps t [s], whether samples were dropped in it."""
    return np.diff(np.asarray(t, dtype=float)) > longest_spacing(t)
