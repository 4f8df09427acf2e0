"""The multi-start on a landscape whose minima are known: where it starts, what goes on, and what is found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from furuta_gym.plant import EFFECTS, TABLE_3, Effect, Plant
from identification.diagnosis.naming.fits import added
from identification.diagnosis.naming.multistart import (
    EffectStart,
    best_of,
    from_best,
    from_other_sizes,
    multi_start,
    resized,
    with_effect,
)
from identification.diagnosis.policy import DecisionPolicy
from tests.identification.diagnosis.fits import NOISE, Bowl, a_fit, search

CURRENT = a_fit(value=1000.0)


def start(*names: str, x: float = 0.0) -> EffectStart:
    return EffectStart(names, a_fit(*names, x=x).plant, NOISE)


def raced(bowls: dict[str, Bowl], policy: DecisionPolicy | None = None, ahead: float | None = None) -> dict[str, float]:
    """The value at which the start of each name is left; all start 1 beside ln θ9 of their minimum."""
    setting = search({"": 1000.0, **bowls}, policy=policy)
    starts = [start(name, x=1.0) for name in bowls]
    fits = multi_start(starts, CURRENT, setting) if ahead is None else multi_start(starts, CURRENT, setting, ahead)
    return {at.effect: fitted.value for at, fitted in fits.items()}


def after(rounds: int, bowl: Bowl) -> float:
    """V after so many rounds of four iterations from 1 beside the minimum."""
    return bowl.value + 100.0 * bowl.rate ** (8 * rounds)


QUICK = Bowl(0.0, rate=0.01)


@pytest.mark.parametrize(("behind", "goes_on"), [(18.0, True), (35.0, False)])
def test_a_fit_goes_on_that_is_near_the_best(behind: float, goes_on: bool) -> None:
    """One that hardly moves is judged by where it is: 25 nats decide."""
    slow = Bowl(behind - 100.0, rate=0.998)
    found = raced({"input_delay": QUICK, "arm_spring": slow})
    assert found["input_delay"] == pytest.approx(0.0, abs=0.05)
    assert found["arm_spring"] == pytest.approx(after(8 if goes_on else 2, slow))


def test_a_fit_that_stands_still_is_left_where_it_is() -> None:
    """However near to the best: what a round no longer moves by a nat is left to the fits to the end."""
    still = Bowl(-82.0, rate=0.9995)
    assert after(1, still) - after(2, still) < 1.0
    assert raced({"input_delay": QUICK, "arm_spring": still})["arm_spring"] == pytest.approx(after(2, still))
    restless = replace(DecisionPolicy(), stands=0.1)
    found = raced({"input_delay": QUICK, "arm_spring": still}, restless)
    assert found["arm_spring"] == pytest.approx(after(8, still))


@pytest.mark.parametrize(("seen", "goes_on"), [(1.0, True), (0.1, False)])
def test_one_that_may_no_longer_catch_up_is_left_at_once(seen: float, goes_on: bool) -> None:
    """After a first round nobody knows its pace, but its derivatives promise something."""
    late = Bowl(-20.0, rate=0.9, seen=seen)
    found = raced({"input_delay": QUICK, "arm_spring": late}, replace(DecisionPolicy(), reach=1.0))
    assert (found["arm_spring"] < after(1, late) - 1.0) == goes_on


def test_one_that_is_far_but_fast_goes_on_and_wins() -> None:
    late = Bowl(-20.0, rate=0.93)
    found = raced({"input_delay": QUICK, "arm_spring": late})
    assert after(2, late) > 2.0, "behind by then"
    assert min(found, key=lambda name: found[name]) == "arm_spring"
    assert found["arm_spring"] == pytest.approx(after(8, late))


def test_one_that_would_take_too_long_is_left() -> None:
    slow = Bowl(80.0, rate=0.97)
    assert raced({"input_delay": QUICK, "arm_spring": slow})["arm_spring"] == pytest.approx(after(2, slow))
    patient = replace(DecisionPolicy(), catches_up=100.0)
    assert raced({"input_delay": QUICK, "arm_spring": slow}, patient)["arm_spring"] < after(4, slow)


def test_half_goes_on_after_each_round_unless_there_is_a_fit_to_beat() -> None:
    names = ["input_delay", "arm_spring", "arm_stribeck", "base_tilt", "input_offset", "input_dead_zone"]
    bowls = {name: Bowl(float(i), rate=0.95) for i, name in enumerate(names)}
    on = [name for name, value in raced(bowls).items() if value < after(1, bowls[name]) - 1.0]
    assert on == names[:3]
    everyone = raced(bowls, ahead=50.0)
    assert all(value < after(4, bowls[name]) for name, value in everyone.items())


def test_the_rounds_are_counted() -> None:
    slow = Bowl(0.0, rate=0.99)
    assert raced({"input_delay": slow})["input_delay"] == pytest.approx(after(8, slow))
    assert raced({"input_delay": slow}, replace(DecisionPolicy(), rounds=3))["input_delay"] == pytest.approx(
        after(3, slow)
    )


def test_nothing_to_start_is_nothing_found() -> None:
    assert multi_start([], CURRENT, search({"": 0.0})) == {}


def test_of_the_starts_of_an_effect_the_best_counts() -> None:
    found = {
        start("arm_backlash"): a_fit("arm_backlash", value=3.0),
        start("arm_backlash"): a_fit("arm_backlash", value=-9.0),
        start("input_delay"): a_fit("input_delay", value=1.0),
    }
    assert {name: fitted.value for name, fitted in best_of(found).items()} == {"arm_backlash": -9.0, "input_delay": 1.0}
    known = {"arm_backlash": a_fit("arm_backlash", value=-10.0), "input_delay": a_fit("input_delay", value=2.0)}
    assert {n: f.value for n, f in best_of(found, known).items()} == {"arm_backlash": -10.0, "input_delay": 1.0}


@pytest.mark.parametrize("name", list(EFFECTS))
def test_another_size_is_within_bounds_or_none(name: str) -> None:
    usual = TABLE_3.default_effect(name)
    for factor in (3.0, 0.6, -1.0):
        other = resized(usual, factor)
        for p in usual.type.parameters if other else ():
            assert other is not None
            assert p.lower <= other.parameters[p.name] <= p.upper
            if p.role == "shape" or p.integer:
                assert other.parameters[p.name] == usual.parameters[p.name]


def test_more_of_a_limit_is_a_lower_limit() -> None:
    for name, size in (("input_saturation", "m"), ("arm_presliding", "σ0")):
        usual = TABLE_3.default_effect(name)
        more = resized(usual, 2.0)
        assert more is not None
        assert more.parameters[size] == pytest.approx(0.5 * usual.parameters[size])
        assert resized(usual, -1.0) is None
    assert resized(Effect("payload_step", {"m": 0.1, "t0": 7.0}), -1.0) == Effect(
        "payload_step", {"m": -0.1, "t0": 7.0}
    )


def test_the_added_effect_is_found_wherever_the_library_keeps_it() -> None:
    """A plant keeps its effects in the library's order, so the last is not the newest."""
    both = a_fit("arm_backlash", "input_delay")
    assert added(both, a_fit("arm_backlash")).name == "input_delay"
    assert added(both, a_fit("input_delay")).name == "arm_backlash"


def test_rivals_find_from_the_bests_parameters_what_they_missed_from_their_own() -> None:
    """… each with its own effect, beside what was found before."""
    hidden = [Bowl(9.0, x=1.0), Bowl(-30.0, x=-1.5)]
    setting = search({"arm_backlash": 100.0, "arm_backlash actuator_lag": hidden, "arm_backlash input_delay": 0.0})
    fits = {
        "input_delay": a_fit("arm_backlash", "input_delay", value=0.0, x=-1.5),
        "actuator_lag": a_fit("arm_backlash", "actuator_lag", value=9.0, x=1.0),
    }
    rivals = {"actuator_lag": TABLE_3.default_effect("actuator_lag")}
    found = from_best("input_delay", rivals, fits, a_fit("arm_backlash", value=100.0), setting)
    assert {e.name for e in found["actuator_lag"].plant.effects} == {"arm_backlash", "actuator_lag"}
    assert found["actuator_lag"].value == pytest.approx(-30.0, abs=0.05)
    assert found["input_delay"] is fits["input_delay"]
    worse = search({"arm_backlash": 100.0, "arm_backlash actuator_lag": Bowl(12.0, x=-1.5)})
    assert from_best("input_delay", rivals, fits, a_fit("arm_backlash"), worse)["actuator_lag"].value == 9.0


@pytest.mark.parametrize(("spring", "arrives"), [(60.0, True), (90.0, False)])
def test_a_rival_that_has_become_a_special_case_starts_again_from_its_grid(spring: float, arrives: bool) -> None:
    """A cable that comes taut where the arm never is: a spring, and nothing draws it back. One that explains more than
    a spring does goes on where it is."""

    def plateau(plant: Plant) -> float:
        taut = plant.effect("arm_taut_cable")
        return 60.0 if taut is not None and abs(taut.parameters["qt"]) > 0.5 else 0.0

    setting = search({"": 1000.0, "arm_ripple": 20.0, "arm_taut_cable": 0.0, "arm_spring": spring}, still=plateau)
    lost = Effect("arm_taut_cable", {"k1": 0.1, "k2": 0.1, "q1n": 0.0, "qt": 3.0})
    fits = {
        "arm_ripple": a_fit("arm_ripple", value=20.0),
        "arm_taut_cable": a_fit(lost, value=60.0),
        "arm_spring": a_fit("arm_spring", value=spring),
    }
    found = from_best("arm_ripple", {"arm_taut_cable": lost}, fits, CURRENT, setting)["arm_taut_cable"]
    assert (found.value < 1.0) == arrives


def resizing(bowls: Sequence[Bowl], name: str, *before: str) -> float:
    """V of an effect that is stuck at 50 at its suggested size, after the starts from other sizes. ln θ9 is 1 away."""
    keys = " ".join((*before, name))
    setting = search({"": 1000.0, " ".join(before): 500.0, keys: [Bowl(50.0, x=1.0), *bowls]})
    current = a_fit(*before, value=500.0, x=1.0)
    suggested = {name: TABLE_3.default_effect(name)}
    fits = {name: a_fit(*before, name, value=50.0, x=1.0)}
    return from_other_sizes([name], suggested, fits, current, setting)[name].value


def test_other_sizes_are_three_times_as_large_or_mirrored_or_at_the_anchor() -> None:
    assert resizing([], "payload_step") == pytest.approx(50.0)
    assert resizing([Bowl(-50.0, x=1.0, sizes={"payload_step": 3.0})], "payload_step") == pytest.approx(-50.0, abs=0.05)
    assert resizing([Bowl(-50.0, x=1.0, sizes={"payload_step": -1.0})], "payload_step") == pytest.approx(-50.0, abs=0.1)
    afresh = Bowl(-50.0, x=0.0, sizes={"payload_step": 3.5})
    assert resizing([afresh], "payload_step") == pytest.approx(-50.0, abs=0.05)


def test_other_sizes_of_a_later_effect_also_start_with_less_of_the_earlier() -> None:
    """What was found before has taken the later one's part as well."""
    shared = [
        Bowl(300.0, x=0.0, sizes={"payload_step": 3.0}),
        Bowl(-50.0, sizes={"input_offset": -0.5, "payload_step": 3.0}),
    ]
    narrow = search({"input_offset": 500.0, "input_offset payload_step": [Bowl(50.0, x=1.0), *shared]})
    current, suggested = (
        a_fit("input_offset", value=500.0, x=1.0),
        {"payload_step": TABLE_3.default_effect("payload_step")},
    )
    fits = {"payload_step": a_fit("input_offset", "payload_step", value=50.0, x=1.0)}
    steep = replace(narrow, fitter=replace(narrow.fitter, steepness=250.0))  # type: ignore[type-var]
    # at the earlier effect's whole size the bowl of 300 is lower (the other: 250 · 1.5² − 50), at 0.6 of it the other
    found = from_other_sizes(["payload_step"], suggested, fits, current, steep)
    assert found["payload_step"].value == pytest.approx(-50.0, abs=0.1)
    whole = replace(steep, policy=replace(steep.policy, smaller=1.0))
    assert from_other_sizes(["payload_step"], suggested, fits, current, whole)["payload_step"].value == 50.0


def test_a_dragged_scale_of_the_pendulum_is_left_for_the_anchors() -> None:
    drift = TABLE_3.replace(theta=TABLE_3.theta * np.array([1, 1, *3 * [1.5], 1, 1, 1, 1]))
    effect = TABLE_3.default_effect("arm_spring")
    start = with_effect(replace(a_fit(), plant=drift), effect, search({}))
    np.testing.assert_array_equal(start.plant.theta, TABLE_3.theta)
    np.testing.assert_allclose(start.noise.packed(), [10.0, 10.0, 1.0, 1.0])
    little = TABLE_3.replace(theta=TABLE_3.theta * np.array([1, 1, *3 * [1.2], 1, 1, 1, 1]))
    start = with_effect(replace(a_fit(), plant=little), effect, search({}))
    np.testing.assert_array_equal(start.plant.theta, little.theta)
    later = replace(a_fit(), plant=drift.with_effects(TABLE_3.default_effect("input_delay")))
    np.testing.assert_array_equal(with_effect(later, effect, search({})).plant.theta, drift.theta)


def test_an_effect_without_a_small_size_starts_with_friction_to_act_on() -> None:
    """Where Coulomb friction ended at zero, the bristle that stands for it would be infinitely stiff for its size."""
    lost = TABLE_3.replace(theta=TABLE_3.theta * np.array([1, 1, 1, 1, 1, 1, 1, 1e-4, 1]))
    effect = lost.default_effect("arm_presliding")
    for plant in (lost, lost.with_effects(TABLE_3.default_effect("input_delay"))):
        start = with_effect(replace(a_fit(), plant=plant), effect, search({}))
        np.testing.assert_array_equal(np.delete(start.plant.theta, 7), np.delete(lost.theta, 7))
        assert start.plant.theta[7] == lost.noticeable("theta8") > 100 * lost.theta[7]
    kept = with_effect(replace(a_fit(), plant=TABLE_3), effect, search({}))
    np.testing.assert_array_equal(kept.plant.theta, TABLE_3.theta)
    other = with_effect(replace(a_fit(), plant=lost), lost.default_effect("arm_stribeck"), search({}))
    np.testing.assert_array_equal(other.plant.theta, lost.theta)
