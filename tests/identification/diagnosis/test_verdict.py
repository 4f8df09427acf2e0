"""The decision rules by themselves, on values made by hand."""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from furuta_gym.plant import TABLE_3, Effect
from identification.diagnosis.naming.forward import unsettled
from identification.diagnosis.policy import DecisionPolicy
from identification.diagnosis.searched import _anchor, _settled, _verdict, _without_sharpness
from identification.diagnosis.sentences import misses
from tests.factories import loop_log
from tests.identification.diagnosis.fits import a_diagnosis, a_fit, an_estimate, naming, rest, search, suspect

POLICY = DecisionPolicy()
AFTER = an_estimate(TABLE_3.with_effects(TABLE_3.default_effect("arm_spring")))
SPRING, DELAY = suspect("arm_spring", 200.0), suspect("input_delay", 200.0)


def nothing_left(p: float = 0.5) -> Any:
    """As `locate` says it where no torque is found."""
    left = rest(p=p)
    left.sentence = "Nothing is left: no torque makes these logs likelier."
    return left


@pytest.mark.parametrize(
    ("found", "left", "verdict"),
    [
        (naming(), rest(), "none"),
        (naming(), rest(evidence=50.0), "unknown"),
        (naming(), rest(p=0.7e-3), "unknown"),
        (naming(), rest(p=1.4e-3), "none"),
        (naming(SPRING), rest(), "named"),
        (naming(SPRING), rest(p=0.7e-3), "named"),
        (naming(SPRING), rest(evidence=50.0), "named"),
        (naming(SPRING), rest(evidence=300.0), "unknown"),
        (naming(DELAY, equals=(("actuator_lag",),)), rest(), "ambiguous"),
    ],
)
def test_the_verdict(found: Any, left: Any, verdict: str) -> None:
    said, sentence = _verdict(found, left, POLICY)
    assert said == verdict
    assert left.structured == ("remains" in sentence)


def test_what_is_refused_is_left_over_and_told() -> None:
    found = naming(suspect("arm_spring", 900.0), refused=suspect("input_delay", 40.0))
    said, sentence = _verdict(found, rest(), POLICY)
    assert said == "named"
    assert "a delay of the command (input_delay) explains a little more (40 nats)" in sentence
    assert a_diagnosis("arm_spring", naming=found).leftover
    assert not a_diagnosis("arm_spring").leftover
    assert a_diagnosis("arm_spring", rest=rest(evidence=50.0)).leftover


def test_a_veto_takes_the_name_and_the_plant_back() -> None:
    found = a_diagnosis("arm_spring")
    assert found.plant is not None
    assert [e.name for e in found.plant.effects] == ["arm_spring"]
    vetoed = found.vetoed()
    assert (vetoed.verdict, vetoed.confirmed) == ("unknown", False)
    assert vetoed.plant is TABLE_3
    assert vetoed.summary.startswith("A cable that pulls like a spring (arm_spring) explains the fitted logs, but")
    assert [s.name for s in vetoed.found] == ["arm_spring"], "still told"


def test_what_names_leave_is_told() -> None:
    short = a_diagnosis("arm_spring", after=AFTER, rest=nothing_left()).falling_short(1.84)
    assert short.verdict == "named"
    assert short.leftover
    assert "still 1.8 times" in short.summary
    assert "what remains shows on held-out data only" in str(short)


def test_nothing_is_left_is_not_said_beside_what_is_left() -> None:
    """One verdict: no later line contradicts the first."""
    refused = naming(suspect("arm_spring", 900.0), refused=suspect("input_delay", 40.0))
    for found in (
        a_diagnosis("arm_spring", after=AFTER, rest=nothing_left()).falling_short(1.84),
        a_diagnosis("arm_spring", after=AFTER, rest=nothing_left(), naming=refused),
        a_diagnosis("arm_spring", after=AFTER, rest=nothing_left(p=0.7e-3)),
    ):
        assert (
            "unexplained structure: no torque stands out of the noise on the searched logs; what remains shows"
            in str(found)
        )
        assert "Nothing is left" not in str(found)
    seen = a_diagnosis("arm_spring", after=AFTER, rest=rest(evidence=50.0))
    assert "unexplained structure: left" in str(seen)
    assert "unexplained structure" not in str(a_diagnosis("arm_spring", after=AFTER, rest=nothing_left()))


@pytest.mark.parametrize(
    ("names", "timed", "repeating"),
    [
        (("arm_spring",), False, False),
        (("arm_friction_drift",), True, False),
        (("periodic_torque", "arm_spring"), True, True),
        (("payload_step",), True, False),
        (("periodic_torque", "arm_friction_drift"), True, False),
    ],
)
def test_what_follows_the_clock_and_what_repeats(names: tuple[str, ...], timed: bool, repeating: bool) -> None:
    found = a_diagnosis(*names)
    assert (found.timed, found.repeating) == (timed, repeating)


def test_what_theta_imitates_is_not_visible() -> None:
    shares = {"arm_ripple": 0.997, "input_offset": 0.993, "arm_spring": 0.2}
    assert a_diagnosis("arm_spring", naming=naming(absorbed=shares)).not_visible == ["arm_ripple"]


def test_the_thresholds_go_with_the_diagnosis() -> None:
    policy = replace(POLICY, believed=20.0)
    found = a_diagnosis("arm_spring", rest=None, policy=policy)
    assert json.loads(json.dumps(found.to_dict()))["policy"] == policy.to_dict()


def test_the_search_starts_off_every_bound() -> None:
    """A fit without the missing effect may end with no friction and no θ2; from there nothing comes back."""
    stuck = TABLE_3.replace(theta=[0.07, 3e-5, 0.024, 0.024, 0.67, 0.0, 0.0, 0.0, 0.0])
    theta = _anchor(stuck, POLICY).theta
    assert (theta[5:] > 0).all()
    assert theta[1] == pytest.approx(0.3 * 0.024)
    assert _anchor(TABLE_3, POLICY).theta[1] == TABLE_3.theta[1]
    assert _anchor(TABLE_3, POLICY).friction_sharpness == 100.0


@pytest.mark.parametrize(
    ("channel", "variable", "rival", "equals"),
    [
        ("input", "command", ("input_cubic_gain", 1950.0), ("input_cubic_gain",)),
        ("input", "command", ("input_cubic_gain", 1700.0), ()),  # explains much less
        ("input", "command", ("input_gain_asymmetry", 1950.0), ()),  # no look-alike
        ("arm", "arm speed", ("input_cubic_gain", 1950.0), ()),  # the form of the saturation may be right
    ],
)
def test_a_form_that_is_wrong_does_not_settle_the_name(
    channel: str, variable: str, rival: tuple[str, float], equals: tuple[str, ...]
) -> None:
    winner = suspect("input_saturation", 2000.0)
    names = naming(winner, rivals=((suspect(*rival),),))
    (unsure,) = unsettled(names, rest(50.0, channel=channel, variable=variable), POLICY).found
    (sure,) = unsettled(names, rest(-4.0, channel=channel, variable=variable), POLICY).found
    assert (unsure.equals, sure.equals) == (equals, ())


@pytest.mark.parametrize(("gain", "equals"), [(3126.0, ("input_offset",)), (2900.0, ())])
def test_where_structure_is_left_a_hundredth_of_the_gain_decides_no_name(gain: float, equals: tuple[str, ...]) -> None:
    """An offset that wanders: a cable that comes taut explains 1.5 % more, and is not it either."""
    winner = suspect("arm_taut_cable", 3174.0)
    names = naming(winner, rivals=((suspect("input_offset", gain),),))
    wandering = rest(50.0, channel="sensor", variable="time (zero of the arm)")
    (unsure,), (sure,) = unsettled(names, wandering, POLICY).found, unsettled(names, rest(-4.0), POLICY).found
    assert (unsure.equals, sure.equals) == (equals, ())


def test_what_is_in_the_plant_beside_an_effect_is_not_in_its_place() -> None:
    """A dead zone whose law a cubic gain describes was called a dead zone or a cubic gain."""
    zone, gain = suspect("input_dead_zone", 1585.0), suspect("input_cubic_gain", 240.0, "input_dead_zone")
    laws = {"input_cubic_gain": "input_dead_zone"}
    names = naming(zone, gain, rivals=((suspect("input_cubic_gain", 1450.0),), ()), laws=laws)
    left = unsettled(names, rest(50.0, channel="input", variable="command"), POLICY)
    assert [effect.equals for effect in left.found] == [(), ()]


def settled(first: Any, second: Any, other: Any, dragged: bool = False) -> tuple[Any, list[str]]:
    """What `_settled` decides between two searches, and which were made ("with": the one that `other` joins)."""
    made: list[str] = []

    def named(joined: Any) -> Any:
        made.append("with" if joined else "without")
        return second if joined else first

    return _settled(named, lambda known: {other.plant.effects[0].name: other}, search({}), dragged), made


@pytest.mark.parametrize(("better", "verdict"), [(7.0, "unknown"), (60.0, "named")])
def test_unknown_is_said_after_a_search_from_other_starts_only(better: float, verdict: str) -> None:
    """… which counts if it explains more than chance would, and than its parameters cost."""
    first = naming(final=a_fit(value=0.0)), None, rest(evidence=50.0)
    second = naming(SPRING, final=a_fit("arm_spring", value=-better)), None, rest()
    (found, _, left), _ = settled(first, second, second[0].final)
    assert _verdict(found, left, POLICY)[0] == verdict


@pytest.mark.parametrize(("better", "name"), [(5.0, "arm_spring"), (200.0, "input_delay")])
def test_names_that_leave_structure_are_searched_again_from_other_starts(better: float, name: str) -> None:
    """Compared with the best single effect, and not with all that was found together."""
    alone = replace(naming(SPRING, final=a_fit("arm_spring", value=100.0)), alone=SPRING.fit)
    first = alone, None, rest(evidence=50.0)
    joining = a_fit("input_delay", value=SPRING.fit.value - better)
    second = naming(DELAY, final=a_fit("input_delay", value=100.0 - better)), None, rest()
    (found, *_), made = settled(first, second, joining)
    assert found.names == [name]
    assert made == (["without", "with"] if name == "input_delay" else ["without"])


def test_where_much_is_missing_other_starts_join_at_once() -> None:
    second = naming(DELAY, final=a_fit("input_delay", value=-900.0)), None, rest(evidence=50.0)
    (found, *_), made = settled(second, second, second[0].final, dragged=True)
    assert found is second[0]
    assert made == ["with"]


def test_a_verdict_that_is_clear_is_not_searched_again() -> None:
    first = naming(SPRING, final=a_fit("arm_spring", value=100.0)), None, rest()
    second = naming(DELAY, final=a_fit("input_delay", value=-900.0)), None, rest()
    (found, *_), made = settled(first, second, second[0].final)
    assert found is first[0]
    assert made == ["without"]


def test_the_model_before_a_sharpness_was_found_does_not_have_it() -> None:
    """An estimate has r free; a gap from it to the same r would be none."""
    log, _ = loop_log(duration=4.0)
    before: Any = SimpleNamespace(plant=TABLE_3.replace(friction_sharpness=12.0))
    other = _without_sharpness(before, naming(SPRING), [log], POLICY)
    assert other is before
    found = naming(suspect("friction_sharpness", 50.0))
    assert _without_sharpness(before, found, [log], POLICY).plant.friction_sharpness == 100.0


@pytest.mark.parametrize(("counts", "verdict"), [(0.02, "none"), (3.0, "unknown")])
def test_what_nobody_would_miss_changes_no_verdict(counts: float, verdict: str) -> None:
    """A long log proves a sixtieth of a count; it is told, with its size."""
    said, sentence = _verdict(naming(), rest(31.0, counts=counts), POLICY)
    assert said == verdict
    assert ("negligible" in sentence) == (verdict == "none")
    beside, sentence = _verdict(naming(SPRING), rest(900.0, counts=counts), POLICY)
    assert beside == ("named" if verdict == "none" else "unknown")
    assert a_diagnosis("arm_spring", rest=rest(31.0, counts=counts)).leftover is (verdict == "unknown")


def test_a_name_taken_back_is_told() -> None:
    found = naming(SPRING, taken_back=(DELAY,))
    verdict, sentence = _verdict(found, rest(), POLICY)
    assert verdict == "named"
    assert (
        "A delay of the command (input_delay) would explain more of these logs, but predictions of held-out" in sentence
    )


def test_equals_that_predict_the_same_ask_for_no_experiment() -> None:
    """A lag of 0.8 ms at a sample time of 2 ms: the names differ, and no prediction does."""
    lag = suspect("actuator_lag", 60.0)
    apart = naming(lag, equals=(("input_delay",),))
    assert _verdict(apart, rest(), POLICY)[0] == "ambiguous"
    alike = replace(apart, found=(replace(apart.found[0], same=("input_delay",)),))
    verdict, sentence = _verdict(alike, rest(), POLICY)
    assert verdict == "named"
    assert "(actuator_lag; input_delay would predict the same)" in sentence


@pytest.mark.parametrize(("n", "told"), [(1.0, True), (7.0, False)])
def test_a_ripple_of_one_period_a_turn_is_told_as_what_it_is(n: float, told: bool) -> None:
    ripple = Effect("arm_ripple", {"A": 0.05, "φ": 0.3, "n": n})
    found = a_diagnosis("arm_ripple", rest=None, after=an_estimate(TABLE_3.with_effects(ripple)))
    assert ("no cogging" in str(found)) is told


def test_what_describes_another_law_of_an_effect_is_told_apart_from_it() -> None:
    """A lag of two time constants: a delay beside it describes the second."""
    found = naming(suspect("input_delay", 150.0), suspect("actuator_lag", 900.0), laws={"input_delay": "actuator_lag"})
    told = a_diagnosis("input_delay", "actuator_lag", naming=found, rest=None)
    assert [s.name for s in told.named] == ["actuator_lag"]
    assert [s.name for s in told.found] == ["input_delay", "actuator_lag"]
    written = told.to_dict()
    assert [e["name"] for e in written["effects"]] == ["actuator_lag"]
    assert [(e["name"], e["law_of"]) for e in written["other_laws"]] == [("input_delay", "actuator_lag")]
    assert "describes what the law of actuator_lag misses" in str(told)
    text = misses(found)
    assert text.startswith("The model misses a lag of the motor (actuator_lag). The law of actuator_lag is not quite")
    assert "input_delay" in text


def test_once_the_effect_is_gone_what_described_its_law_is_an_effect() -> None:
    found = naming(suspect("input_delay", 150.0), laws={"input_delay": "actuator_lag"})
    assert [s.name for s in found.own] == ["input_delay"]
    assert found.describes("input_delay") is None


def test_a_look_alike_of_what_only_describes_a_law_makes_nothing_ambiguous() -> None:
    laws = {"input_delay": "actuator_lag"}
    two = suspect("input_delay", 150.0), suspect("actuator_lag", 900.0)
    for equals, verdict in (((("arm_backlash",), ()), "named"), (((), ("arm_backlash",)), "ambiguous")):
        found = naming(*two, equals=equals, laws=laws)
        assert _verdict(found, rest(), POLICY)[0] == verdict


def test_a_diagnosis_whose_names_were_taken_back_leaves_structure_whatever_they_left() -> None:
    found = a_diagnosis("arm_spring", rest=nothing_left()).vetoed()
    assert found.leftover
    assert "held-out data are not predicted better" in str(found)
    assert "unexplained torque" not in str(found), "that is what the names left"
