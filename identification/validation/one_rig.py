"""Whether logs that one plant does not explain are of one rig: each is fitted alone, and the plants are compared."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from furuta_gym.plant import THETA_NAMES

from ..estimation.estimate import Estimate
from ..estimation.identify import identify
from ..logs.log import Log
from .adequacy import SMALL_BELOW, Adequacy
from .gap import Gap, validate

_CERTAIN = 4.0  # standard deviations, of a difference
_ONE_FACTOR = 0.05  # of a factor, within which all θ share it
_SHARED = 4  # parameters at least, which must share a factor


@dataclass(frozen=True)
class OneByOne:
    """Fits of the single logs. sources: their names. ratios: error over the noise floor of each log with its own
    plant. factors: of the θ that differ for certain, by name, the largest factor from the first log to another."""

    sources: tuple[str, ...]
    ratios: tuple[float, ...]
    factors: Mapping[str, float]

    def to_dict(self) -> dict[str, Any]:
        """As JSON has it."""
        return {"ratio_to_floor": list(self.ratios), "factors": dict(self.factors)}

    def __str__(self) -> str:
        ratios = ", ".join(f"{ratio:.2f}" for ratio in self.ratios)
        told = (
            f"Each log alone, with a plant of its own, is predicted to {ratios} times the noise floor. So they are of "
            "different rigs, or the rig changed between them: fit them one at a time"
        )
        values = np.array(list(self.factors.values()))
        if len(values) >= _SHARED and float(np.ptp(values)) < _ONE_FACTOR * float(np.median(values)):
            return (
                f"{told}. {', '.join(self.factors)} differ by one factor, {float(np.median(values)):.3g}: look at the "
                "supply, the driver, and the command's unit or scale"
            )
        differ = ", ".join(f"{name} by a factor of {factor:.3g}" for name, factor in self.factors.items())
        return f"{told}. What differs from {self.sources[0]}: {differ}" if differ else told


def one_by_one(estimate: Estimate, gap: Gap, logs: Sequence[Log], **options: Any) -> OneByOne | None:
    """Fits of each log alone, where one plant does not explain them together and each alone is explained.

    estimate: of all logs together, gap: its error on them. options: of `identify`. None where the logs have a plant in
    common, or a log alone is not explained either, or cannot be fitted.
    """
    if len(logs) < 2 or gap.judgement.adequacy is not Adequacy.INADEQUATE:
        return None
    alone: list[Estimate] = []
    ratios: list[float] = []
    for log in logs:
        try:
            found = identify(log, method=estimate.method, **options)
            ratio = validate(found.plant, log).ratio_to_floor
        except ValueError:
            return None
        if ratio > min(SMALL_BELOW, 0.5 * gap.ratio_to_floor):
            return None
        alone.append(found)
        ratios.append(ratio)
    return OneByOne(tuple(log.source for log in logs), tuple(ratios), _factors(alone))


def _factors(alone: Sequence[Estimate]) -> dict[str, float]:
    """The largest factor of each θ from the first estimate to another, where the difference is certain."""
    first, found = alone[0], dict[str, float]()
    for other in alone[1:]:
        weak = {*first.identifiability.unidentified, *other.identifiability.unidentified}
        for name in THETA_NAMES:
            if name in weak or name not in first.names or name not in other.names:
                continue
            a, b = first.value(name), other.value(name)
            spread = np.hypot(first.std[first.names.index(name)], other.std[other.names.index(name)])
            if a <= 0 or b <= 0 or not abs(b - a) > _CERTAIN * spread:
                continue
            if name not in found or abs(np.log(b / a)) > abs(np.log(found[name])):
                found[name] = b / a
    return found
