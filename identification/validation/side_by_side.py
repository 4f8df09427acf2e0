"""Estimated parameters side by side: which of them differ by more than chance."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.stats import chi2

from furuta_gym.plant import THETA_NAMES, Plant
from furuta_gym.plant.covariance import NORMAL_95

from ..estimation.estimate import Estimate
from ..estimation.identifiability import spoken
from ..kalman.coordinates import SHARPNESS_NAMES
from ..normal_equations import ScaledGram

CERTAIN = 3.0
"""Standard deviations, from which a difference is no chance."""
_ONE_FACTOR = 0.99  # of the chi-squared distribution, within which all θ differ by one factor
_SHARED = 4  # parameters at least, which must share a factor
_LARGEST = 10.0  # such factor
ROUNDING = 1e-10
"""Of a scaled covariance, as a plant file holds it: smaller directions are not trusted."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Estimated:
    """Parameters by name, their values (n,) and the covariance (n, n) of their errors. lost: names that the logs did
    not show, or whose errors nobody knows."""

    names: tuple[str, ...]
    values: Array
    covariance: Array
    lost: frozenset[str] = frozenset()

    @classmethod
    def of_estimate(cls, estimate: Estimate) -> Estimated:
        lost = {*estimate.identifiability.unidentified, *estimate.at_bound, *_rough(estimate.plant)}
        return cls(estimate.names, estimate.values, estimate.covariance, frozenset(lost))

    @classmethod
    def of_plant(cls, plant: Plant) -> Estimated:
        """What a plant file says was estimated. Raises ValueError where it has no error bars.

        r is lost: it shows in the few samples near a reversal alone, where rounding is no noise, and its error may be
        many times its standard deviation.
        """
        if plant.covariance is None:
            raise ValueError(
                "a plant has no error bars; expected a plant file as `furuta identify LOG -o rig.json` writes it"
            )
        known = {*plant.layout.names, "r"}  # an effect may have been taken out of the file since
        covariance = plant.covariance.without(*(name for name in plant.covariance.names if name not in known))
        names = covariance.names
        # a single r stands in the row of the arm's
        p, rows = plant.packed().p, [plant.layout.row("r1" if name == "r" else name) for name in names]
        of_a_day = {f"{e.name}.{p.name}" for e in plant.effects for p in e.type.parameters if p.of_a_day}
        at_bound = plant.checks.get("at_bound")
        stuck = map(str, at_bound) if isinstance(at_bound, list | tuple) else ()
        lost = {*plant.not_identified, *stuck, *_rough(plant), *SHARPNESS_NAMES, *of_a_day}
        return cls(names, p[rows], covariance.matrix, frozenset(lost & {*names}))

    def value(self, name: str) -> float:
        return float(self.values[self.names.index(name)])

    def std(self, name: str) -> float:
        i = self.names.index(name)
        return math.sqrt(max(float(self.covariance[i, i]), 0.0))

    def of(self, names: Sequence[str]) -> tuple[Array, Array]:
        """Values and covariance of some."""
        which = [self.names.index(name) for name in names]
        return self.values[which], self.covariance[np.ix_(which, which)]


@dataclass(frozen=True)
class Difference:
    """A parameter in two estimates: (value, standard deviation) of each, and its unit."""

    name: str
    before: tuple[float, float]
    after: tuple[float, float]
    unit: str = ""

    @property
    def spread(self) -> float:
        """Standard deviation of the difference of two independent estimates."""
        return math.hypot(self.before[1], self.after[1])

    @property
    def sure(self) -> float:
        """The difference in standard deviations, with its sign."""
        change = self.after[0] - self.before[0]
        return change / self.spread if self.spread > 0 else math.copysign(math.inf, change) if change else 0.0

    @property
    def certain(self) -> bool:
        return abs(self.sure) > CERTAIN

    @property
    def factor(self) -> float | None:
        """after / before, where both have the same sign."""
        return self.after[0] / self.before[0] if self.before[0] * self.after[0] > 0 else None

    @property
    def percent(self) -> tuple[float, float] | None:
        """The change in percent and half of its 95 % interval, to first order; None where the sign changed."""
        if self.factor is None:
            return None
        (a, of_a), (b, of_b) = self.before, self.after
        return 100.0 * (b / a - 1.0), 100.0 * NORMAL_95 * math.hypot(of_b / a, b * of_a / a**2)

    @property
    def shows_from(self) -> float | None:
        """The smallest change in percent that would be certain; None for a value of zero."""
        return 100.0 * CERTAIN * self.spread / abs(self.before[0]) if self.before[0] else None

    def __str__(self) -> str:
        if self.percent is None:
            return f"{spoken([self.name])} from {self.before[0]:.3g} to {self.after[0]:.3g} {self.unit}".rstrip()
        change, half = self.percent
        return f"{spoken([self.name])} {change:+.3g} % ({change - half:+.3g} … {change + half:+.3g} %)"


def factors(first: Estimated, others: Sequence[Estimated], names: Collection[str]) -> dict[str, float]:
    """Of those of `names` that differ for certain, the largest factor from the first estimate to another."""
    found = dict[str, float]()
    for other in others:
        for name in first.names:
            if name in first.lost | other.lost or name not in other.names or name not in names:
                continue
            between = difference(first, other, name)
            factor = between.factor
            if factor is None or not between.certain:
                continue
            if name not in found or abs(math.log(factor)) > abs(math.log(found[name])):
                found[name] = factor
    return found


def one_factor(first: Estimated, others: Sequence[Estimated]) -> float | None:
    """The largest factor by which all θ of an estimate are those of the first, where no estimate needs more than one;
    None where one does, or none differs for certain."""
    found = [_common_factor(first, other) for other in others]
    certain = [factor for factor, misfit, gained, allowed in found if gained > CERTAIN**2]
    if not certain or any(misfit > allowed for _, misfit, _, allowed in found):
        return None
    return max(certain, key=lambda factor: abs(math.log(factor)))


def one_factor_told(of: str, factor: float) -> str:
    """What it means if all θ differ by one factor. of: from what they differ."""
    return (
        f"All θ differ from {of} by one factor, {factor:.3g}: look at the supply, the driver, and the command's unit "
        "or scale"
    )


def _rough(plant: Plant) -> set[str]:
    """Parameters whose likelihood is too rough for an error bar (see `Estimate.std`)."""
    return {f"{e.name}.{p.name}" for e in plant.effects for p in e.type.parameters if e.type.rough}


def difference(a: Estimated, b: Estimated, name: str, unit: str = "") -> Difference:
    """A parameter that both estimate."""
    return Difference(name, (a.value(name), a.std(name)), (b.value(name), b.std(name)), unit)


def _common_factor(first: Estimated, other: Estimated) -> tuple[float, float, float, float]:
    """The factor c for which θ of the other is nearest to c θ of the first, the squared distance in standard
    deviations, how much smaller it is than without a factor, and how large chance makes it."""
    names = [n for n in THETA_NAMES if n in first.names and n in other.names and n not in first.lost | other.lost]
    (a, of_a), (b, of_b) = first.of(names), other.of(names)

    def misfit(log_factor: float) -> float:
        c = math.exp(log_factor)
        return 2.0 * ScaledGram.of(of_b + c**2 * of_a).gain(b - c * a, ROUNDING).gain

    best = minimize_scalar(misfit, bounds=(-math.log(_LARGEST), math.log(_LARGEST)), method="bounded")
    gained = misfit(0.0) - float(best.fun) if len(names) >= _SHARED else 0.0
    return math.exp(best.x), float(best.fun), gained, float(chi2.ppf(_ONE_FACTOR, max(len(names) - 1, 1)))
