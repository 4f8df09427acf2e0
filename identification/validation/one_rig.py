"""Whether logs that one plant does not explain are of one rig: each is fitted alone, and the plants are compared."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from furuta_gym.plant import THETA_NAMES

from ..estimation.estimate import Estimate
from ..estimation.identify import identify
from ..logs.log import Log
from .adequacy import ADEQUATE_BELOW, SMALL_BELOW, Adequacy
from .gap import Gap, validate
from .side_by_side import Estimated, factors, one_factor, one_factor_told


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
            told.append(one_factor_told(self.sources[0], self.one_factor))
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
    if len(logs) < 2 or gap.by_size.adequacy is not Adequacy.INADEQUATE:
        return None
    return apart(
        [(log.source, (log,)) for log in logs],
        gap.ratio_to_floor,
        lambda part: identify(part, method=estimate.method, **options),
    )


def explained_below(ratio: float, adequate: float = ADEQUATE_BELOW) -> float:
    """The error over the noise floor up to which a part of the logs is explained, where one plant for all leaves
    `ratio`: half of it, or what is called adequate."""
    return max(adequate, min(SMALL_BELOW, 0.5 * ratio))


def apart(
    parts: Sequence[tuple[str, Sequence[Log]]],
    ratio: float,
    fitted: Callable[[Sequence[Log]], Estimate],
    adequate: float = ADEQUATE_BELOW,
) -> OneByOne | None:
    """Fits of each part of the logs, if each is explained so. None where one is not, or cannot be fitted.

    parts: names and logs. ratio: error over the noise floor of one plant for all of them. fitted(logs) gives the
    estimate of a part. adequate: see `explained_below`.
    """
    estimates: list[Estimate] = []
    ratios: list[float] = []
    for _, logs in parts:
        try:
            found = fitted(logs)
            own = validate(found.plant, logs).ratio_to_floor
        except ValueError:
            return None
        if own > explained_below(ratio, adequate):
            return None
        estimates.append(found)
        ratios.append(own)
    sizes = {f"{e.name}.{p.name}" for e in estimates[0].plant.effects for p in e.type.parameters if p.role == "size"}
    first, *others = map(Estimated.of_estimate, estimates)
    return OneByOne(
        tuple(name for name, _ in parts),
        tuple(ratios),
        factors(first, others, {*THETA_NAMES, *sizes}),
        one_factor(first, others),
        tuple(estimates),
        ratio,
    )
