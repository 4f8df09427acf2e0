"""What differs between two plants, beyond their error bars: whether the rig has changed between two logs."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.stats import chi2

from furuta_gym.plant import THETA_NAMES, Plant
from furuta_gym.plant.covariance import NORMAL_95

from ..estimation.estimate import Estimate, unit_of
from ..estimation.identifiability import spoken
from ..normal_equations import ScaledGram

CERTAIN = 3.0
"""Standard deviations, from which a difference is no chance."""
_BY_CHANCE = float(chi2.sf(CERTAIN**2, 1))  # so much for all of them together
_ONE_FACTOR = 0.99  # of the chi-squared distribution, within which all θ differ by one factor
_SHARED = 4  # parameters at least, which must share a factor
_LARGEST = 10.0  # such factor
_ROUNDING = 1e-14  # of a scaled covariance

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
        lost = {*estimate.identifiability.unidentified, *_rough(estimate.plant)}
        return cls(estimate.names, estimate.values, estimate.covariance, frozenset(lost))

    @classmethod
    def of_plant(cls, plant: Plant) -> Estimated:
        """What a plant file says was estimated. Raises ValueError where it has no error bars."""
        if plant.covariance is None:
            raise ValueError("has no error bars; expected a plant file as `furuta identify LOG -o rig.json` writes it")
        names = plant.covariance.names
        # a single r stands in the row of the arm's
        p, rows = plant.packed().p, [plant.layout.row("r1" if name == "r" else name) for name in names]
        return cls(names, p[rows], plant.covariance.matrix, frozenset({*plant.not_identified, *_rough(plant)}))

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


@dataclass(frozen=True)
class PlantChange:
    """What differs between two plants of a rig.

    differences: of what both estimate and their logs show. unjudged: names that one of them does not show, or that only
    one estimates. one_factor: by which all θ differ, if they do by one. chi2, degrees: of all differences together.
    only_before, only_after: effects that one of the plants has alone. shared_logs: logs that both were fitted to.
    """

    differences: tuple[Difference, ...]
    unjudged: tuple[str, ...]
    one_factor: float | None
    chi2: float
    degrees: int
    only_before: tuple[str, ...] = ()
    only_after: tuple[str, ...] = ()
    shared_logs: tuple[str, ...] = ()

    @property
    def p(self) -> float:
        """How often two logs of an unchanged rig differ as much, all parameters together."""
        return float(chi2.sf(self.chi2, self.degrees)) if self.degrees else 1.0

    @property
    def certain(self) -> tuple[Difference, ...]:
        """Differences that are no chance."""
        return tuple(d for d in self.differences if d.certain)

    @property
    def changed(self) -> bool | None:
        """Whether the parameters differ for certain; None where the plants cannot be compared."""
        if self.only_before or self.only_after or self.shared_logs or not self.differences:
            return None
        return bool(self.certain) or self.p < _BY_CHANCE

    def to_dict(self) -> dict[str, Any]:
        """As JSON has it. null stands for what is infinite or not defined."""
        return {
            "changed": self.changed,
            "parameters": {
                d.name: {
                    "before": {"value": d.before[0], "std": d.before[1]},
                    "after": {"value": d.after[0], "std": d.after[1]},
                    "unit": d.unit,
                    "factor": d.factor,
                    "deviations": d.sure if math.isfinite(d.sure) else None,
                    "certain": d.certain,
                    "shows_from_percent": d.shows_from,
                }
                for d in self.differences
            },
            "not_judged": list(self.unjudged),
            "one_factor": self.one_factor,
            "chi2": self.chi2,
            "degrees_of_freedom": self.degrees,
            "p": self.p,
            "effects": {"only_before": list(self.only_before), "only_after": list(self.only_after)},
            "shared_logs": list(self.shared_logs),
        }

    def __str__(self) -> str:
        lines = []
        if self.only_before or self.only_after:
            each = ((self.only_before, "first"), (self.only_after, "second"))
            said = " and ".join(f"only the {which} has {', '.join(names)}" for names, which in each if names)
            lines.append(
                f"These plants cannot be compared: {said}, and an effect changes every θ. Fit both logs with the same "
                "effects: furuta identify LOG --effects NAMES"
            )
        if self.shared_logs:
            lines.append(
                f"These plants cannot be compared: both were fitted to {', '.join(self.shared_logs)}. Fit each to logs "
                "of its own"
            )
        if lines:
            return "\n".join(f"{line}." for line in lines)
        if self.one_factor is not None:
            lines.append(one_factor_told("those of the first", self.one_factor))
        if certain := [d for d in self.certain if self.one_factor is None or d.name not in THETA_NAMES]:
            lines.append(f"Differs by more than {CERTAIN:g} standard deviations: {', '.join(map(str, certain))}")
        odds = f"chi² {self.chi2:.3g} with {self.degrees} degrees of freedom, p = {self.p:.2g}"
        if not self.differences:
            lines.append("No parameter shows in both")
        elif not self.certain and self.p < _BY_CHANCE:
            lines.append(f"No single parameter differs for certain, but all together do: {odds}")
        elif not self.certain:
            lines.append(f"No change shows: no parameter differs by {CERTAIN:g} standard deviations; {odds}")
        return "\n".join(f"{line}." for line in lines)


def plant_change(before: Plant, after: Plant) -> PlantChange:
    """What differs between two plants whose logs are others. Their errors are taken as independent.

    Raises ValueError where a plant has no error bars, or the commands have different units.
    """
    if before.unit != after.unit:
        raise ValueError(f"one command is in {before.unit}, the other in {after.unit}; expected one unit for both")
    a, b = Estimated.of_plant(before), Estimated.of_plant(after)
    shared = [name for name in a.names if name in b.names and name not in a.lost | b.lost]
    (x, of_x), (y, of_y) = a.of(shared), b.of(shared)
    gained = ScaledGram.of(of_x + of_y).gain(y - x, _ROUNDING) if shared else None
    names = [{e.name for e in plant.effects} for plant in (before, after)]
    known = {entry.get("sha256"): str(entry.get("source")) for entry in after.provenance.get("logs") or []}
    logs = [known.get(entry.get("sha256")) for entry in before.provenance.get("logs") or [] if entry.get("sha256")]
    return PlantChange(
        tuple(_difference(a, b, name, unit_of(name, before)) for name in shared),
        tuple(name for name in dict.fromkeys((*a.names, *b.names)) if name not in shared),
        one_factor(a, [b]),
        2.0 * gained.gain if gained else 0.0,
        gained.rank if gained else 0,
        tuple(sorted(names[0] - names[1])),
        tuple(sorted(names[1] - names[0])),
        tuple(log for log in logs if log is not None),
    )


def factors(first: Estimated, others: Sequence[Estimated], names: Collection[str]) -> dict[str, float]:
    """Of those of `names` that differ for certain, the largest factor from the first estimate to another."""
    found = dict[str, float]()
    for other in others:
        for name in first.names:
            if name in first.lost | other.lost or name not in other.names or name not in names:
                continue
            difference = _difference(first, other, name)
            factor = difference.factor
            if factor is None or not difference.certain:
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
    return {f"{e.name}.{p.name}" for e in plant.effects for p in e.type.parameters if p.rough}


def _difference(a: Estimated, b: Estimated, name: str, unit: str = "") -> Difference:
    return Difference(name, (a.value(name), a.std(name)), (b.value(name), b.std(name)), unit)


def _common_factor(first: Estimated, other: Estimated) -> tuple[float, float, float, float]:
    """The factor c for which θ of the other is nearest to c θ of the first, the squared distance in standard
    deviations, how much smaller it is than without a factor, and how large chance makes it."""
    names = [n for n in THETA_NAMES if n in first.names and n in other.names and n not in first.lost | other.lost]
    (a, of_a), (b, of_b) = first.of(names), other.of(names)

    def misfit(log_factor: float) -> float:
        c = math.exp(log_factor)
        return 2.0 * ScaledGram.of(of_b + c**2 * of_a).gain(b - c * a, _ROUNDING).gain

    best = minimize_scalar(misfit, bounds=(-math.log(_LARGEST), math.log(_LARGEST)), method="bounded")
    gained = misfit(0.0) - float(best.fun) if len(names) >= _SHARED else 0.0
    return math.exp(best.x), float(best.fun), gained, float(chi2.ppf(_ONE_FACTOR, max(len(names) - 1, 1)))
