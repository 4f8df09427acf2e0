"""Uncertainty of a prediction-error fit: classical and sandwich covariance, profile likelihood."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..normal_equations import ScaledGram
from .optimise import Expansion, minimise
from .prediction_error import PredictionError

_BLOCK = 0.5  # s; scores are summed over blocks at least this long, so that correlation inside them counts
_MOST_BLOCKS = 80
_POINTS, _ITERATIONS = 4, 15  # of a profile: over three standard deviations, and of the fit at each
_LEVEL = 3.84  # of the deviance: 95 % of χ² with one degree of freedom


@dataclass(frozen=True)
class FitCovariance:
    """Covariances (n, n) of all coordinates z of a fit, noise included."""

    classical: NDArray[np.float64]
    sandwich: NDArray[np.float64]


def fit_covariance(problem: PredictionError, expansion: Expansion) -> FitCovariance:
    """Classical H⁻¹ and sandwich H⁻¹ J H⁻¹, J from block sums of the scores (`expansion` must hold them)."""
    if expansion.scores is None:
        raise ValueError("the expansion holds no scores; make it with expand(z, exact=True, scores=True)")
    inverse = inverse_information(expansion.information)
    total = sum(r.duration for r in problem.records)
    block = max(_BLOCK, total / _MOST_BLOCKS)
    blocks = []
    for record, scores in zip(problem.records, expansion.scores, strict=True):
        edges = np.searchsorted(record.t, record.t[0] + np.arange(0.0, record.duration + 1e-9, block))
        blocks.append(np.add.reduceat(scores, edges[edges < len(record.t)], axis=0))
    sums = np.concatenate(blocks)
    sums = sums - sums.mean(axis=0)
    meat = sums.T @ sums * (len(sums) / max(len(sums) - 1, 1))
    return FitCovariance(inverse, inverse @ meat @ inverse)


def recommended(classical: NDArray[np.float64], sandwich: NDArray[np.float64]) -> NDArray[np.float64]:
    """The classical covariance with each deviation raised to the sandwich's where that is larger.

    The classical one is right and steady for white innovations; where they are not white it is too small. The
    sandwich says by how much, but rests on some dozens of blocks of time: it may widen an interval, never narrow it.
    The correlations stay the classical ones, so the matrix stays positive definite.
    """
    ratio = np.diag(sandwich) / np.maximum(np.diag(classical), 1e-300)
    factor = np.sqrt(np.maximum(ratio, 1.0))
    return classical * np.outer(factor, factor)


def inverse_information(H: NDArray[np.float64]) -> NDArray[np.float64]:
    """H⁻¹ through a scaled eigendecomposition; directions without information get a huge, finite variance."""
    return ScaledGram.of(H, 1e-30).inverse(1e-13)


@dataclass(frozen=True)
class Profile:
    """Profile likelihood of one coordinate: values (m,), twice the loss of log-likelihood (m,), 95 % interval, of
    which an end that was not found is NaN."""

    name: str
    values: NDArray[np.float64]
    deviance: NDArray[np.float64]
    interval: tuple[float, float]

    def to_dict(self) -> dict[str, Any]:
        return {
            "interval": [end if math.isfinite(end) else None for end in self.interval],
            "values": self.values.tolist(),
            "deviance": self.deviance.tolist(),
        }

    def __str__(self) -> str:
        low, high = (f"{end:.4g}" if math.isfinite(end) else "open" for end in self.interval)
        return f"Profile of {self.name}: 95 % interval {low} to {high}"


def profile(problem: PredictionError, z: NDArray[np.float64], name: str, std: float) -> Profile:
    """Refit everything else with `name` held at values on either side, three quarters of a standard deviation `std`
    (of the coordinate) apart, until the deviance passes 6 or a bound is met, nine of them at most.

    An end of the interval is NaN where the deviance does not reach 3.84 within that, and there is no bound. Raises
    ValueError for a name that is no free parameter.
    """
    names = [c.name for c in problem.coordinates]
    if name not in names:
        raise ValueError(f"no free parameter {name!r} to profile; there are {', '.join(names)}")
    i = names.index(name)
    free = [k for k in range(len(z)) if k != i]
    best = problem.value(z)
    found: list[tuple[float, float]] = [(float(z[i]), 0.0)]
    for side in (-1.0, 1.0):
        at = z.copy()
        for k in range(1, 3 * _POINTS + 1):
            at[i] = np.clip(z[i] + side * k * std * 3.0 / _POINTS, problem.low[i], problem.high[i])
            fit = minimise(problem, at, _ITERATIONS, free=free)
            if not math.isfinite(fit.value):
                break
            at = fit.z.copy()
            found.append((float(at[i]), 2.0 * (fit.value - best)))
            if found[-1][1] > 6.0 or at[i] in (problem.low[i], problem.high[i]):
                break
    found.sort()
    zs, deviance = np.array(found).T
    to_value = problem.coordinates[i].to_value
    bounds = float(problem.low[i]), float(problem.high[i])
    low, high = (_crossing(zs, deviance, side, bound) for side, bound in zip((-1, 1), bounds, strict=True))
    interval = (to_value(low), to_value(high))
    return Profile(name, np.array([to_value(x) for x in zs]), deviance, interval)


def _crossing(z: NDArray[np.float64], deviance: NDArray[np.float64], side: int, bound: float) -> float:
    """Where the signed root of the deviance passes `_LEVEL` on one side; else the bound if it was met, or NaN."""
    low = int(np.argmin(deviance))
    zs, roots = (z[low:], deviance[low:]) if side > 0 else (z[: low + 1][::-1], deviance[: low + 1][::-1])
    roots = np.sqrt(np.maximum(roots - deviance[low], 0.0))
    past = np.flatnonzero(roots >= math.sqrt(_LEVEL))
    if not past.size:
        return bound if zs[-1] == bound else math.nan
    k = int(past[0])
    w = (math.sqrt(_LEVEL) - roots[k - 1]) / (roots[k] - roots[k - 1])
    return float(zs[k - 1] + w * (zs[k] - zs[k - 1]))
