"""Whether a plant still describes its rig, by a limit that is the rig's own: the answer of a check every week."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

from .adequacy import SMALL_BELOW, Adequacy
from .gap import Gap
from .noise_floor import RESTING_SAYS


class Answer(Enum):
    """What a check found, in words; `exit_code` is that of `furuta validate --limit`."""

    HOLDS = "the plant describes the rig in these logs"
    FAILS = "the plant does not describe the rig in these logs"
    UNKNOWN = "nobody can say"

    @property
    def exit_code(self) -> int:
        return {Answer.HOLDS: 0, Answer.FAILS: 10, Answer.UNKNOWN: 11}[self]


@dataclass(frozen=True)
class Checked:
    """answer: of the check. limit: the largest error over the noise floor that passes; here: of these logs. why: it was
    answered so, in words."""

    answer: Answer
    limit: float
    here: float
    why: str

    def to_dict(self) -> dict[str, Any]:
        return {"answer": self.answer.name.lower(), "limit": self.limit, "why": self.why}

    def __str__(self) -> str:
        return f"Check: {self.answer.value}. {self.why}."


def checked(gap: Gap, limit: float, fitted: Sequence[str] = ()) -> Checked:
    """Compare a gap with a limit of at least 1. fitted: which of its logs the plant was fitted to.

    Where an angle rests the floor is too low, and four times the limit is needed to say that the plant fails. A small
    error proves nothing where the floor is in doubt. Raises ValueError for a limit below 1 or not finite.
    """
    if not 1.0 <= limit < float("inf"):
        raise ValueError(f"--limit {limit:g}: expected 1 or more, as 1 is a perfect plant")
    ratio = gap.ratio_to_floor
    largest = limit * RESTING_SAYS / SMALL_BELOW if gap.at_rest else limit
    over = f"The error is {ratio:.2f} times the noise floor"

    def answered(answer: Answer, why: str) -> Checked:
        return Checked(answer, limit, ratio, why)

    if not ratio <= largest:
        return answered(Answer.FAILS, f"{over}, and the limit is {largest:g}")
    if gap.at_rest:
        return answered(Answer.UNKNOWN, f"{over}, but {gap.at_rest}")
    if gap.changed:
        return answered(Answer.UNKNOWN, f"{over}, but {gap.changed}")
    if fitted:
        return answered(Answer.UNKNOWN, f"The plant was fitted to {', '.join(fitted)}: take a log that was not fitted")
    judged = gap.judgement
    if judged.mostly_torque:
        share = 100 * float(gap.torque_share.max())
        return answered(Answer.UNKNOWN, f"{over}, but {share:.0f} % of that floor is torque noise fitted to these logs")
    if judged.adequacy is Adequacy.UNKNOWN:
        return answered(Answer.UNKNOWN, f"{over}, which no plant can be: something has raised the floor")
    return answered(Answer.HOLDS, f"{over}, and the limit is {limit:g}")
