"""Whether a further effect only describes the law of another one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import pytest

from furuta_gym import Effect
from identification.diagnosis.naming.judge import Judge
from identification.diagnosis.policy import DecisionPolicy
from tests.identification.diagnosis.fits import RECORD, a_fit, ranked
from tests.identification.diagnosis.silence import NoRest, NoWitness

JUDGE = Judge(DecisionPolicy(), NoRest(), NoWitness())


@pytest.mark.parametrize(
    ("n", "beside", "law_of"),
    [
        (14.0, "arm_cable", "arm_cable"),
        (14.0, "arm_spring", "arm_spring"),
        (16.0, "arm_cable", None),  # two periods and more
        (14.0, "input_delay", None),  # no function of the arm's angle
    ],
)
def test_a_ripple_that_is_not_seen_to_repeat_is_another_function_of_the_angle(
    n: float, beside: str, law_of: str | None
) -> None:
    """The arm of these records turns by 0.84 rad, a seventh of a turn and more."""
    assert RECORD.y[:, 0].max() - RECORD.y[:, 0].min() == pytest.approx(0.84, abs=0.01)
    before = a_fit(beside)
    both = a_fit(beside, Effect("arm_ripple", {"A": 0.1, "n": n, "φ": 0.0}), value=-500.0)
    together = [ranked((beside, 2000.0), fit=before), ranked(("arm_ripple", 500.0), fit=both)]
    assert JUDGE.law_of(together, before) == law_of


@dataclass(frozen=True)
class Laws:
    """A `Rest` whose evidence [nats] for another law of each effect is known, in a fit `before`; of all others, and in
    all other fits, there is none."""

    of: Mapping[str, float]
    before: Any

    def left(self, fitted: Any) -> float:
        return 0.0

    def another_law(self, fitted: Any, name: str) -> float:
        return self.of.get(name, 0.0) if fitted is self.before else 0.0


@dataclass(frozen=True)
class Closed(Laws):
    """The same, where the fit `before` leaves structure of 300 nats, and every other one so much."""

    rest: float = 0.0

    def left(self, fitted: Any) -> float:
        return 300.0 if fitted is self.before else self.rest


@pytest.mark.parametrize(
    ("newest", "gain", "rest", "law_of"),
    [
        ("arm_coulomb_asymmetry", 520.0, 0.0, None),  # two effects, and nothing else is left
        ("arm_coulomb_asymmetry", 520.0, 40.0, "input_dead_zone"),  # something is: another law may be all of it
        ("arm_coulomb_asymmetry", 150.0, 0.0, "input_dead_zone"),  # a small part, as laws differ by
        ("input_cubic_gain", 520.0, 0.0, "input_dead_zone"),  # a look-alike bends the same curve
    ],
)
def test_what_is_all_that_was_missing_is_no_law_of_an_effect_unlike_it(
    newest: str, gain: float, rest: float, law_of: str | None
) -> None:
    """Friction that differs by direction beside a dead zone: its torque goes with the sign of the command too."""
    before = a_fit("input_dead_zone")
    both = a_fit("input_dead_zone", newest, value=-gain)
    together = [ranked(("input_dead_zone", 1200.0), fit=before), ranked((newest, gain), fit=both)]
    judge = Judge(DecisionPolicy(), Closed({"input_dead_zone": 320.0}, before, rest), NoWitness())
    assert judge.law_of(together, before) == law_of


@pytest.mark.parametrize(
    ("n", "newest", "law_of", "ripple"),
    [
        (16.0, "arm_spring", None, None),  # pulls one way, turn after turn
        (16.0, "arm_cable", None, None),
        (14.0, "arm_spring", None, "arm_ripple"),  # less than two periods: the ripple followed the spring's law
        (14.0, "arm_position_friction", "arm_ripple", None),  # no function of the angle alone
    ],
)
def test_a_spring_beside_a_ripple_is_an_effect_and_the_ripple_may_be_its_law(
    n: float, newest: str, law_of: str | None, ripple: str | None
) -> None:
    cogging = Effect("arm_ripple", {"A": 0.1, "n": n, "φ": 0.0})
    before = a_fit(cogging)
    together = [
        ranked(("arm_ripple", 2000.0), fit=before),
        ranked((newest, 500.0), fit=a_fit(cogging, newest, value=-500.0)),
    ]
    judge = Judge(DecisionPolicy(), Laws({"arm_ripple": 400.0}, before), NoWitness())
    assert judge.law_of(together, before) == law_of
    assert judge.look_alike_law_of(together) is None
    assert judge.ripple_of_law(together) == ripple


@pytest.mark.parametrize(
    ("first", "newest", "gain", "law_of"),
    [
        ("actuator_lag", "input_delay", 700.0, "actuator_lag"),
        ("input_saturation", "input_cubic_gain", 240.0, "input_saturation"),
        ("friction_sharpness", "arm_stribeck", 90.0, "friction_sharpness"),  # of both speeds, and of one
        ("actuator_lag", "input_delay", 1300.0, None),  # more than half as much
        ("input_dead_zone", "input_saturation", 300.0, None),  # seen at other commands: no look-alikes
        ("arm_cable", "base_tilt", 300.0, None),  # look-alikes in other variables
        ("arm_coulomb_asymmetry", "friction_sharpness", 300.0, "arm_coulomb_asymmetry"),  # whose law has r in it
        ("arm_quadratic_drag", "friction_sharpness", 300.0, None),  # which has none
    ],
)
def test_a_lesser_look_alike_in_the_same_variables_may_as_well_be_another_law(
    first: str, newest: str, gain: float, law_of: str | None
) -> None:
    both = a_fit(first, newest, value=-gain)
    together = [ranked((first, 2000.0), fit=a_fit(first)), ranked((newest, gain), fit=both)]
    assert JUDGE.look_alike_law_of(together) == law_of


@pytest.mark.parametrize("n", [8.0, 16.0])
def test_a_ripple_is_no_lesser_look_alike_of_a_cable(n: float) -> None:
    """Whether it only describes the cable's law, its periods say."""
    both = a_fit("arm_cable", Effect("arm_ripple", {"A": 0.1, "n": n, "φ": 0.0}), value=-300.0)
    together = [ranked(("arm_cable", 2000.0), fit=a_fit("arm_cable")), ranked(("arm_ripple", 300.0), fit=both)]
    assert JUDGE.look_alike_law_of(together) is None


@pytest.mark.parametrize(
    ("before", "after", "beside", "foreign"),
    [
        (90.0, None, None, True),  # a tenth of the gain at most
        (900.0, None, None, False),
        (900.0, 890.0, None, True),  # still there with the effect in the model: something else leaves it
        (900.0, 700.0, None, False),
        (900.0, 1100.0, None, True),
        (-20.0, 90.0, None, True),
        (900.0, 700.0, ("base_tilt",), True),  # beside the cable it is not slight, so that is not asked
    ],
)
def test_what_goes_with_the_law_of_another_effect_counts_as_far_as_it_goes_with_the_newest(
    before: float, after: float | None, beside: tuple[str, ...] | None, foreign: bool
) -> None:
    without, fitted = a_fit("arm_cable", "base_tilt"), a_fit("arm_cable", "base_tilt", "input_delay", value=-1000.0)

    class Left(NoRest):
        def another_law(self, fit: Any, name: str) -> float:
            if name == "base_tilt":
                return 0.0
            return before if fit is without else after or 0.0

    judge = Judge(DecisionPolicy(), Left(), NoWitness())
    assert judge.foreign(1000.0, without, None if after is None else fitted, beside) is foreign
    assert not judge.foreign(99.0, without, fitted, ("base_tilt",))  # too little to be told from anything
    # beside one that came with it, all that was there is asked
    apart = ("base_tilt", "arm_spring")
    assert judge.foreign(1000.0, without, fitted, apart) is judge.foreign(1000.0, without, fitted)


@pytest.mark.parametrize("exchanged", [False, True])
def test_what_was_exchanged_with_a_small_effect_is_not_held_for_its_own(exchanged: bool) -> None:
    """What goes with the tilt's variables is left by both models, and the second has another cable besides."""
    before = a_fit("base_tilt", "arm_spring")
    cable = "arm_taut_cable" if exchanged else "arm_spring"
    after = a_fit("base_tilt", cable, "input_cubic_gain", value=-200.0)

    class Left(NoRest):
        def another_law(self, fit: Any, name: str) -> float:
            return 300.0

    judge = Judge(DecisionPolicy(), Left(), NoWitness())
    together = [ranked(("base_tilt", 5000.0), fit=before), ranked(("input_cubic_gain", 200.0), fit=after)]
    assert judge.slight(together, together[-1][0], before) is exchanged
