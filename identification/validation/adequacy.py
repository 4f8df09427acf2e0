"""Whether a plant is adequate: what its prediction error says beside the noise floor."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

ADEQUATE_BELOW = 1.1
"""Error over the floor below which nothing of size is missing."""
SMALL_BELOW = 2.0
"""Error over the floor below which what is missing is small."""
_DOUBTFUL = 0.75  # ratio to the floor below which it is the floor that is wrong
_MOSTLY_TORQUE = 0.95  # share of the floor from which torque noise is all of it: with known noise it stays below 0.85


class Adequacy(StrEnum):
    """A judgement of a plant on logs."""

    ADEQUATE = "adequate"
    SMALL = "something small is missing"
    INADEQUATE = "not adequate"
    UNKNOWN = "cannot be judged"


@dataclass(frozen=True)
class Judgement:
    """adequacy: of the plant. mostly_torque: the floor is nearly all torque noise, for which torques that the plant
    misses pass as well."""

    adequacy: Adequacy
    mostly_torque: bool

    @property
    def floor_in_doubt(self) -> bool:
        """Whether the noise floor cannot be trusted."""
        return self.mostly_torque or self.adequacy is Adequacy.UNKNOWN

    @classmethod
    def of(cls, ratio: float, torque_share: float, adequate: float = ADEQUATE_BELOW) -> Judgement:
        """From the error over the noise floor and the share of the floor that is torque noise. adequate: the ratio
        below which nothing of size is missing."""
        mostly = torque_share > _MOSTLY_TORQUE
        if ratio < _DOUBTFUL or (mostly and ratio < SMALL_BELOW):
            return cls(Adequacy.UNKNOWN, mostly)
        if ratio < adequate:
            return cls(Adequacy.ADEQUATE, mostly)
        return cls(Adequacy.SMALL if ratio < SMALL_BELOW else Adequacy.INADEQUATE, mostly)
