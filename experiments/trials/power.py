"""Power curves: how large must an effect be to be named? A logistic curve with lapses, by its posterior on a grid.

The curve is the psychometric function of Wichmann & Hill (2001), Percept. Psychophys. 63, 1293: logistic in the
logarithm of what is visible, and a share of lapses, misses that size does not explain. A posterior on a grid instead
of a maximum is the way of Schütt et al. (2016), Vision Res. 122, 105: honest for a handful of trials, and where all or
none were named.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

SLOPE, SLOPE_SD = 2.0, 1.5
MIDDLE_SD = 3.0
LAPSES = 30
"""Prior of the share of lapses: Beta(1, 30), 3 % in the mean."""

_DRAWS = 1000
_COARSE, _FINE = (49, 17, 9), (91, 31, 15)

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PowerCurve:
    """P(named right) = (1 − λ) expit(b (x − x50)) with x = ln(ratio − 1): draws (1000, 3) of (x50, ln b, λ).

    `limit` is "" or says that no trial missed ("below": only the upper ends of intervals mean something) or that none
    was named ("above"). tried: smallest and largest ratio of the trials.
    """

    trials: int
    right: int
    draws: Array
    limit: str
    tried: tuple[float, float]

    def probability(self, ratio: Array) -> Array:
        """Median and 95 % interval (3, len(ratio)) of P(named right) at these gap ratios: low, median, high."""
        x50, log_slope, lapse = self.draws.T[:, :, None]
        p = (1.0 - lapse) * expit(np.exp(log_slope) * (np.log(ratio - 1.0) - x50))
        return np.quantile(p, [0.025, 0.5, 0.975], axis=0)

    def ratio_at(self, share: float) -> tuple[float, float, float]:
        """Gap ratio at which this share is named: low, median, high of its 95 % interval; inf if never, for lapses."""
        x50, log_slope, lapse = self.draws.T
        odds = np.where(1.0 - lapse > share, share / np.maximum(1.0 - lapse - share, 1e-12), np.inf)
        ratio = 1.0 + np.exp(np.minimum(x50 + np.log(odds) / np.exp(log_slope), 700.0))
        ratio[~np.isfinite(odds)] = np.inf
        low, median, high = np.quantile(ratio, [0.025, 0.5, 0.975], method="nearest")
        return float(low), float(median), float(high)


def fit_power(ratios: Sequence[float], right: Sequence[bool]) -> PowerCurve | None:
    """Posterior of the three coefficients; None without trials that show at all (ratio above 1).

    Priors: ln b ~ N(ln 2, 1.5²), λ ~ Beta(1, 30) and x50 ~ N(m, 3²), m the mean x of the trials: a ratio − 1 twenty
    times larger or smaller than theirs is one standard deviation.
    """
    kept = [(math.log(r - 1.0), y) for r, y in zip(ratios, right, strict=True) if r > 1.0 + 1e-6]
    if not kept:
        return None
    x, y = np.array([x for x, _ in kept]), np.array([y for _, y in kept], dtype=bool)
    middle, log_slope = float(x.mean()), math.log(SLOPE)
    axes = [
        np.linspace(middle - 4.0 * MIDDLE_SD, middle + 4.0 * MIDDLE_SD, _COARSE[0]),
        np.linspace(log_slope - 3.0 * SLOPE_SD, log_slope + 3.0 * SLOPE_SD, _COARSE[1]),
        np.linspace(0.0, 0.4, _COARSE[2]),
    ]
    axes = [_around(axis, mass, n) for axis, mass, n in zip(axes, _marginals(_weights(axes, x, y)), _FINE, strict=True)]
    weights = _weights(axes, x, y)
    # systematic resampling: the same draws every time
    place = np.searchsorted(np.cumsum(weights.ravel()), (np.arange(_DRAWS) + 0.5) / _DRAWS).clip(max=weights.size - 1)
    draws = np.stack([axis[i] for axis, i in zip(axes, np.unravel_index(place, weights.shape), strict=True)], axis=1)
    return PowerCurve(
        trials=len(kept),
        right=int(y.sum()),
        draws=draws,
        limit="below" if y.all() else "" if y.any() else "above",
        tried=(1.0 + math.exp(x.min()), 1.0 + math.exp(x.max())),
    )


def _weights(axes: Sequence[Array], x: Array, y: NDArray[np.bool_]) -> Array:
    """Posterior mass of every cell of the grid (x50, ln b, λ)."""
    x50, log_slope, lapse = np.meshgrid(*axes, indexing="ij", sparse=True)
    total = (LAPSES - 1) * np.log1p(-lapse) - 0.5 * ((log_slope - math.log(SLOPE)) / SLOPE_SD) ** 2
    total = total - 0.5 * ((x50 - float(x.mean())) / MIDDLE_SD) ** 2
    slope = np.exp(log_slope)
    for one, named in zip(x, y, strict=True):
        p = (1.0 - lapse) * expit(slope * (one - x50))
        total = total + (np.log(np.maximum(p, 1e-300)) if named else np.log1p(-np.minimum(p, 1.0 - 1e-15)))
    weights = np.exp(total - total.max())
    return weights / weights.sum()


def _marginals(weights: Array) -> list[Array]:
    return [weights.sum(axis=tuple(j for j in range(3) if j != i)) for i in range(3)]


def _around(axis: Array, mass: Array, n: int) -> Array:
    """n points over the part of the axis that holds all but a millionth of the mass, and a step beyond."""
    kept = np.flatnonzero(mass > 1e-6 * mass.max())
    step = axis[1] - axis[0]
    return np.linspace(max(axis[0], axis[kept[0]] - step), min(axis[-1], axis[kept[-1]] + step), n)
