"""Whether a further effect only describes the law of another one."""

from __future__ import annotations

import pytest

from furuta_gym import Effect
from identification.diagnosis.naming.judge import Judge, NoRest, NoWitness
from identification.diagnosis.policy import DecisionPolicy
from tests.identification.diagnosis.fits import RECORD, a_fit, ranked

JUDGE = Judge(DecisionPolicy(), NoRest(), NoWitness())


@pytest.mark.parametrize(
    ("n", "beside", "law_of"),
    [
        (7.0, "arm_cable", "arm_cable"),
        (7.0, "arm_spring", "arm_spring"),
        (8.0, "arm_cable", None),  # a period and more
        (7.0, "input_delay", None),  # no function of the arm's angle
    ],
)
def test_less_than_a_period_of_a_ripple_is_another_function_of_the_angle(
    n: float, beside: str, law_of: str | None
) -> None:
    """The arm of these records turns by 0.84 rad, a seventh of a turn and more."""
    assert RECORD.y[:, 0].max() - RECORD.y[:, 0].min() == pytest.approx(0.84, abs=0.01)
    before = a_fit(beside)
    both = a_fit(beside, Effect("arm_ripple", {"A": 0.1, "n": n, "φ": 0.0}), value=-500.0)
    together = [ranked((beside, 2000.0), fit=before), ranked(("arm_ripple", 500.0), fit=both)]
    assert JUDGE.law_of(together, before) == law_of
