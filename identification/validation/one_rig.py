"""Whether logs that one plant does not explain are of one rig: each is fitted alone, and the plants are compared."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.stats import chi2

from furuta_gym.plant import THETA_NAMES

from ..estimation.estimate import Estimate
from ..estimation.identify import identify
from ..logs.log import Log
from ..normal_equations import ScaledGram
from .adequacy import ADEQUATE_BELOW, SMALL_BELOW, Adequacy
from .gap import Gap, validate

_CERTAIN = 3.0  # standard deviations, of a difference
_ONE_FACTOR = 0.99  # of the chi-squared distribution, within which all θ differ by one factor
_SHARED = 4  # parameters at least, which must share a factor
_LARGEST = 10.0  # such factor
_ROUNDING = 1e-14  # of a scaled covariance

Array = NDArray[np.float64]


@dataclass(frozen=True)
class OneByOne:
    """Fits of single logs, or of parts of them. sources: their names. ratios: error over the noise floor of each with
    its own plant, together: of one plant for all of them. factors: of the θ and sizes of effects that differ for
    certain, by name, the largest factor from the first to another. one_factor: by which all θ differ, if they do by
    one. estimates: the fits."""

    sources: tuple[str, ...]
    ratios: tuple[float, ...]
    factors: Mapping[str, float]
    one_factor: float | None = None
    estimates: tuple[Estimate, ...] = field(default=(), repr=False, compare=False)
    together: float = np.inf

    def to_dict(self) -> dict[str, Any]:
        """As JSON has it."""
        return {"ratio_to_floor": list(self.ratios), "factors": dict(self.factors), "one_factor": self.one_factor}

    @property
    def what_differs(self) -> str:
        """The parameters that differ for certain, in words; empty without any."""
        told = []
        shared = THETA_NAMES if self.one_factor is not None else ()
        if self.one_factor is not None:
            told.append(
                f"All θ differ from {self.sources[0]} by one factor, {self.one_factor:.3g}: look at the supply, the "
                "driver, and the command's unit or scale"
            )
        factors = [f"{name} by a factor of {factor:.3g}" for name, factor in self.factors.items() if name not in shared]
        if factors:
            told.append(f"What {'else ' if told else ''}differs from {self.sources[0]}: {', '.join(factors)}")
        return ". ".join(told)

    def __str__(self) -> str:
        ratios = ", ".join(f"{ratio:.2f}" for ratio in self.ratios)
        told = (
            f"Each log alone, with a plant of its own, is predicted to {ratios} times the noise floor. So they are of "
            "different rigs, or the rig changed between them: fit them one at a time"
        )
        return ". ".join(part for part in (told, self.what_differs) if part)


def one_by_one(estimate: Estimate, gap: Gap, logs: Sequence[Log], **options: Any) -> OneByOne | None:
    """Fits of each log alone, where one plant does not explain them together and each alone is explained.

    estimate: of all logs together, gap: its error on them. options: of `identify`. None where the logs have a plant in
    common, or a log alone is not explained either, or cannot be fitted.
    """
    if len(logs) < 2 or gap.judgement.adequacy is not Adequacy.INADEQUATE:
        return None
    return apart(
        [(log.source, (log,)) for log in logs],
        gap.ratio_to_floor,
        lambda part: identify(part, method=estimate.method, **options),
    )


def explained_below(ratio: float) -> float:
    """The error over the noise floor up to which a part of the logs is explained, where one plant for all leaves
    `ratio`: half of it, or what is called adequate."""
    return max(ADEQUATE_BELOW, min(SMALL_BELOW, 0.5 * ratio))


def apart(
    parts: Sequence[tuple[str, Sequence[Log]]], ratio: float, fitted: Callable[[Sequence[Log]], Estimate]
) -> OneByOne | None:
    """Fits of each part of the logs, if each is explained so. None where one is not, or cannot be fitted.

    parts: names and logs. ratio: error over the noise floor of one plant for all of them. fitted(logs) gives the
    estimate of a part.
    """
    estimates: list[Estimate] = []
    ratios: list[float] = []
    for _, logs in parts:
        try:
            found = fitted(logs)
            own = validate(found.plant, logs).ratio_to_floor
        except ValueError:
            return None
        if own > explained_below(ratio):
            return None
        estimates.append(found)
        ratios.append(own)
    return OneByOne(
        tuple(name for name, _ in parts),
        tuple(ratios),
        _factors(estimates),
        _one_factor(estimates),
        tuple(estimates),
        ratio,
    )


def _factors(estimates: Sequence[Estimate]) -> dict[str, float]:
    """The largest factor of each θ and size from the first estimate to another, where the difference is certain."""
    first, found = estimates[0], dict[str, float]()
    sizes = {f"{e.name}.{p.name}" for e in first.plant.effects for p in e.type.parameters if p.role == "size"}
    for other in estimates[1:]:
        weak = {*first.identifiability.unidentified, *other.identifiability.unidentified}
        for name in first.names:
            if name in weak or name not in other.names or name not in {*THETA_NAMES, *sizes}:
                continue
            a, b = first.value(name), other.value(name)
            spread = np.hypot(first.std[first.names.index(name)], other.std[other.names.index(name)])
            if a * b <= 0 or not abs(b - a) > _CERTAIN * spread:
                continue
            if name not in found or abs(np.log(b / a)) > abs(np.log(found[name])):
                found[name] = b / a
    return found


def _one_factor(estimates: Sequence[Estimate]) -> float | None:
    """The largest factor by which all θ of an estimate are those of the first, where no estimate needs more than one;
    None where one does, or none differs for certain."""
    first, *others = estimates
    found = [_common_factor(first, other) for other in others]
    certain = [factor for factor, misfit, gained, allowed in found if gained > _CERTAIN**2]
    if not certain or any(misfit > allowed for _, misfit, _, allowed in found):
        return None
    return max(certain, key=lambda factor: abs(np.log(factor)))


def _common_factor(first: Estimate, other: Estimate) -> tuple[float, float, float, float]:
    """The factor c for which θ of the other is nearest to c θ of the first, the squared distance in standard
    deviations, how much smaller it is than without a factor, and how large chance makes it."""
    weak = {*first.identifiability.unidentified, *other.identifiability.unidentified}
    names = [n for n in THETA_NAMES if n in first.names and n in other.names and n not in weak]
    (a, of_a), (b, of_b) = (_values(estimate, names) for estimate in (first, other))

    def misfit(log_factor: float) -> float:
        c = float(np.exp(log_factor))
        return 2.0 * ScaledGram.of(of_b + c**2 * of_a).gain(b - c * a, _ROUNDING).gain

    best = minimize_scalar(misfit, bounds=(-np.log(_LARGEST), np.log(_LARGEST)), method="bounded")
    gained = misfit(0.0) - float(best.fun) if len(names) >= _SHARED else 0.0
    return float(np.exp(best.x)), float(best.fun), gained, float(chi2.ppf(_ONE_FACTOR, max(len(names) - 1, 1)))


def _values(estimate: Estimate, names: Sequence[str]) -> tuple[Array, Array]:
    which = [estimate.names.index(name) for name in names]
    return estimate.values[which], estimate.covariance[np.ix_(which, which)]
