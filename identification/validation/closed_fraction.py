"""How much of a gap one plant closes against another, with an interval over blocks of time."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .gap import Gap

Array = NDArray[np.float64]

FEWEST_BLOCKS = 5
"""Blocks of time below which a bootstrap says nothing certain: of one block every draw is the same."""

_UNDEFINED = 0.025  # of the draws: the interval's own tail


def time_blocks(gap: Gap, block: float = 1.0) -> tuple[NDArray[np.int_], int]:
    """The block of time (M,) in which each window ends, and how many there are: of `block` seconds, as neighbouring
    windows overlap, or of the horizon where that leaves fewer than `FEWEST_BLOCKS`."""
    group, groups = np.zeros(len(gap.times), dtype=int), 1
    for width in (block, min(block, gap.horizon)):
        _, found = np.unique(np.stack([gap.log, np.floor(gap.times / width)]), axis=1, return_inverse=True)
        group = found.ravel()
        groups = int(group.max()) + 1
        if groups >= FEWEST_BLOCKS:
            break
    return group, groups


@dataclass(frozen=True)
class ClosedFraction:
    """Share of the squared gap above the floor that one plant closes against another, with a 95 % interval: NaN where
    the windows are too few for one, or there may have been no gap."""

    value: float
    interval: tuple[float, float]

    def __str__(self) -> str:
        if not np.isfinite(self.value):
            return "none: the error was at the floor before"
        return f"{100 * self.value:.1f} % ({self.spoken})"

    @property
    def spoken(self) -> str:
        """The interval in words."""
        low, high = (100 * end for end in self.interval)
        none = "no interval: too few windows, or an error near the floor before"
        return f"95 %: {low:.1f} … {high:.1f} %" if math.isfinite(low) else none


def closed_fraction(before: Gap, after: Gap, seed: int = 0, draws: int = 1000, block: float = 1.0) -> ClosedFraction:
    """(before − after) / (before − floor), squared and over both axes, each in units of its floor; at most 1.

    The floor is the lower of the two, because what a wrong plant does not explain can only raise it. The interval is
    a bootstrap over `time_blocks`. It is NaN, so that nothing counts as certain, of fewer than `FEWEST_BLOCKS`, and
    where more than `_UNDEFINED` of the draws have no gap before, and so no share of it. Raises
    ValueError if the two gaps are not of the same logs and horizon.
    """
    if before.errors.shape != after.errors.shape or before.horizon != after.horizon:
        raise ValueError("the two gaps must be of the same logs and the same horizon")
    floor = np.minimum(before.floor, after.floor)
    b = np.sum((before.errors / floor) ** 2, axis=1)
    a = np.sum((after.errors / floor) ** 2, axis=1)
    group, groups = time_blocks(before, block)
    sums = np.stack([np.bincount(group, x, groups) for x in (b, a, np.full(len(a), 2.0))])
    value = float(_fraction(sums.sum(axis=1)))
    if groups < FEWEST_BLOCKS:
        return ClosedFraction(value, (math.nan, math.nan))
    picked = np.random.default_rng(seed).integers(0, groups, (draws, groups))
    fractions = [_fraction(s) for s in np.moveaxis(sums[:, picked].sum(axis=2), 1, 0)]
    if not math.isfinite(value) or np.mean(np.isnan(fractions)) > _UNDEFINED:
        return ClosedFraction(value, (math.nan, math.nan))
    low, high = np.nanquantile(fractions, [0.025, 0.975])
    return ClosedFraction(value, (float(low), float(high)))


def _fraction(sums: Array) -> float:
    before, after, floor = sums
    return min(float((before - after) / (before - floor)), 1.0) if before > floor else math.nan
