"""Power curves: how large must an effect be to be named? Logistic regression on the logarithm of what is visible."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.special import expit

SLOPE, SLOPE_SD = 2.0, 1.5
MIDDLE_SD = 3.0


@dataclass(frozen=True)
class PowerCurve:
    """P(named right) = expit(b (x − x50)) with x = ln(ratio − 1).

    ratio50, ratio95: gap ratios at which half and 95 % are named; interval50: 95 % interval of ratio50 (Laplace).
    `limit` is "" or says that no trial missed ("below": the curve is an upper limit) or that none was named ("above").
    tried: smallest and largest ratio of the trials.
    """

    trials: int
    right: int
    slope: float
    ratio50: float
    interval50: tuple[float, float]
    ratio95: float
    limit: str
    tried: tuple[float, float]

    def probability(self, ratio: np.ndarray) -> np.ndarray:
        """P(named right) at these gap ratios."""
        return expit(self.slope * (np.log(ratio - 1.0) - math.log(self.ratio50 - 1.0)))


def fit_power(ratios: Sequence[float], right: Sequence[bool]) -> PowerCurve | None:
    """Maximum a posteriori of the two coefficients; None without trials that show at all (ratio above 1).

    Priors keep the curve finite where the answers are separable: ln b ~ N(ln 2, 1.5²) and x50 ~ N(m, 3²), m the mean x
    of the trials: a ratio − 1 twenty times larger or smaller than theirs is one standard deviation.
    """
    kept = [(math.log(r - 1.0), y) for r, y in zip(ratios, right, strict=True) if r > 1.0 + 1e-6]
    if not kept:
        return None
    x = np.array([x for x, _ in kept])
    y = np.array([float(y) for _, y in kept])
    middle = float(x.mean())

    def cost(p: np.ndarray) -> float:
        z = math.exp(p[1]) * (x - p[0])
        likelihood = np.sum(np.logaddexp(0.0, z) - y * z)
        prior = ((p[0] - middle) / MIDDLE_SD) ** 2 + ((p[1] - math.log(SLOPE)) / SLOPE_SD) ** 2
        return float(likelihood + 0.5 * prior)

    found = minimize(cost, np.array([middle, math.log(SLOPE)]), method="BFGS")
    x50, slope = float(found.x[0]), math.exp(found.x[1])
    sd = math.sqrt(found.hess_inv[0, 0])
    return PowerCurve(
        trials=len(kept),
        right=int(y.sum()),
        slope=slope,
        ratio50=1.0 + math.exp(x50),
        interval50=(1.0 + math.exp(x50 - 1.96 * sd), 1.0 + math.exp(x50 + 1.96 * sd)),
        ratio95=1.0 + math.exp(x50 + math.log(19.0) / slope),
        limit="below" if y.all() else "" if y.any() else "above",
        tried=(1.0 + math.exp(x.min()), 1.0 + math.exp(x.max())),
    )
