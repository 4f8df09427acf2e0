"""The gap of a plant log by log, and by the kind of experiment: one figure for all can hide where a plant fails."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import Plant
from furuta_gym.plant.effects.words import number
from identification.logs.kind import kind_of
from identification.logs.log import Log
from identification.validation.gap import Gap, over_floor, validate

_SAID = {"hanging": "hanging logs", "upright": "upright logs", "whole turns": "logs with whole turns"}


@dataclass(frozen=True)
class OneLog:
    """Prediction errors on one log. rms (2,) [rad]: of q1 and q2 at the horizon; ratio: over the floor of all logs of
    its kind; None for both where the log is too short to be predicted."""

    name: str
    kind: str
    rms: NDArray[np.float64] | None
    ratio: float | None

    def __str__(self) -> str:
        if self.rms is None:
            return f"{self.name} ({self.kind})  too short to be predicted"
        arm, pendulum = (number(1e3 * float(x)) for x in self.rms)
        return f"{self.name} ({self.kind})  q1 {arm} mrad, q2 {pendulum} mrad, {self.ratio:.2f} times the noise floor"

    def to_dict(self) -> dict[str, Any]:
        rms = (None, None) if self.rms is None else tuple(map(float, self.rms))
        return {
            "name": self.name,
            "kind": self.kind,
            "rms_q1": rms[0],
            "rms_q2": rms[1],
            "ratio_to_floor": self.ratio,
        }


@dataclass(frozen=True)
class Parts:
    """A gap in parts. by_kind: the gap of each kind of experiment, with a floor of its own; nothing where all logs are
    of one kind."""

    by_log: tuple[OneLog, ...]
    by_kind: dict[str, Gap]

    def __str__(self) -> str:
        lines = ["By log:", *(f"  {one}" for one in self.by_log)]
        return "\n".join([*lines, *(gap.told(f"on {_SAID[kind]}") for kind, gap in self.by_kind.items())])

    def to_dict(self) -> dict[str, Any]:
        kinds = {kind: gap.to_dict()["gap"] for kind, gap in self.by_kind.items()}
        return {"by_log": [one.to_dict() for one in self.by_log], "by_kind": kinds}


def parts_of(plant: Plant, gap: Gap, logs: Sequence[Log]) -> Parts:
    """The parts of the gap of `plant` on `logs`. Kinds are predicted again, for floors of their own."""
    kinds: dict[str, list[Log]] = {}
    for i, log in enumerate(logs):
        if np.any(gap.log == i):
            kinds.setdefault(kind_of(log), []).append(log)
    several = kinds if len(kinds) > 1 else {}
    by_kind = {kind: validate(plant, some, gap.horizon) for kind, some in several.items()}
    return Parts(tuple(_one(gap, by_kind, i, log) for i, log in enumerate(logs)), by_kind)


def _one(gap: Gap, by_kind: Mapping[str, Gap], i: int, log: Log) -> OneLog:
    errors, kind = gap.errors[gap.log == i], kind_of(log)
    if not len(errors):
        return OneLog(log.source, kind, None, None)
    rms, floor = np.sqrt(np.mean(errors**2, axis=0)), by_kind.get(kind, gap).floor
    return OneLog(log.source, kind, rms, over_floor(rms, floor))
