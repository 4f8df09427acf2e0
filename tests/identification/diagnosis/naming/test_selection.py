"""Forward selection as a whole, on landscapes whose minima are known: which names are found, and which refused."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from tests.identification.diagnosis.fits import PER_PARAMETER, Bowl, Scores, Told, a_fit, named, search
from tests.identification.diagnosis.silence import names_found


@pytest.mark.parametrize(("net", "believed"), [(7.0, False), (14.0, True)])
def test_an_effect_is_believed_that_gains_ten_nats_more_than_it_costs(net: float, believed: bool) -> None:
    found = named({"input_delay": -net - PER_PARAMETER}, "input_delay", "arm_spring")
    assert found.names == (["input_delay"] if believed else [])
    assert found.rankings[0][0].name == "input_delay"
    assert found.final.plant.effects == (found.rankings[0][0].fit.plant.effects if believed else ())


@pytest.mark.parametrize(("behind", "equal"), [(3.5, True), (7.0, False)])
def test_what_is_five_nats_behind_is_no_equal(behind: float, equal: bool) -> None:
    found = named({"input_delay": -200.0, "actuator_lag": behind - 200.0}, "input_delay", "actuator_lag", "arm_spring")
    assert found.names == ["input_delay"]
    assert found.found[0].equals == (("actuator_lag",) if equal else ())


STAND_IN = {
    "base_tilt": -900.0,
    "input_offset": -300.0,
    "pendulum_stribeck": -600.0,
    "base_tilt pendulum_stribeck": -1150.0,
    "input_offset pendulum_stribeck": -1500.0,
}


def test_a_name_is_exchanged_when_another_joins_and_what_is_too_small_is_refused() -> None:
    """The base's tilt stood in for an offset; 40 nats are left for a sharpness, less than a tenth of the largest."""
    small = STAND_IN | {"friction_sharpness input_offset pendulum_stribeck": -1540.0}
    names = ("base_tilt", "input_offset", "pendulum_stribeck", "friction_sharpness")
    found = named(small, *names)
    assert found.names == ["input_offset", "pendulum_stribeck"]
    assert found.refused is not None
    assert found.refused.name == "friction_sharpness"
    assert found.final.value == pytest.approx(-1500.0, abs=0.05)
    assert [round(effect.suspect.gain) for effect in found.found] == [900, 1200]


def test_where_the_fit_with_what_was_found_had_stalled_the_search_goes_on_from_the_better_one() -> None:
    """The delay's fit ends far above its minimum, where no score suggests the drag. The tilt's way leads lower, and
    explains nothing there. The search then goes on from there, and the delay has the gain of the lower fit."""
    landscape = {
        "": 0.0,
        "input_delay": [Bowl(-400.0), Bowl(-900.0, x=4.0)],
        "base_tilt input_delay": Bowl(-903.0, x=4.0),
        "input_delay pendulum_quadratic_drag": Bowl(-1300.0, x=4.0),
    }
    by = search(landscape)

    def scorer(current: Any, only: Any, quieter: float = 1.0, policy: Any = None) -> dict[str, Any]:
        seen = "pendulum_quadratic_drag" if current.value < -800.0 else "base_tilt" if current.value else "input_delay"
        return Scores({seen: 500.0})(current, only, quieter, policy)

    found = names_found(a_fit(), replace(by, scorer=scorer))
    assert found.names == ["input_delay", "pendulum_quadratic_drag"]
    assert found.final.value == pytest.approx(-1300.0, abs=0.05)
    assert found.rankings[0][0].gain == pytest.approx(900.0, abs=1.0)


@pytest.mark.parametrize(("until", "names"), [(0.0, ["base_tilt"]), (math.inf, ["input_offset", "pendulum_stribeck"])])
def test_when_the_time_is_over_no_further_step_is_begun(until: float, names: list[str]) -> None:
    by = search({"": 0.0, **STAND_IN}, "base_tilt", "input_offset", "pendulum_stribeck")
    found = names_found(a_fit(), replace(by, until=until))
    assert found.names == names
    assert found.ended_early is (until == 0.0)


def test_no_more_are_found_than_asked_for() -> None:
    steps = {
        "input_delay": -3000.0,
        "input_delay base_tilt": -5000.0,
        "input_delay base_tilt pendulum_stribeck": -6500.0,
    }
    names = ("input_delay", "base_tilt", "pendulum_stribeck")
    for most in (1, 2, 3):
        assert named(steps, *names, most=most).names == list(names[:most])


@pytest.mark.parametrize(
    ("gain", "before", "after", "believed"),
    [
        (280.0, 50.0, -4.0, True),  # what was left is gone
        (280.0, 14.0, -4.0, True),
        (280.0, 7.0, -4.0, False),  # hardly anything was left
        (280.0, -4.0, -4.0, False),  # nothing was left: a mended form
        (280.0, 50.0, 20.0, False),  # something still is
        (140.0, 50.0, -4.0, False),  # too small even so: a tenth of the largest is the least
        (300.0, -4.0, -4.0, False),
        (600.0, -4.0, -4.0, True),  # large enough by itself: a fifth
        (600.0, 50.0, 650.0, False),  # leaves more than it explains
    ],
)
def test_a_small_further_effect_must_be_just_what_was_missing(
    gain: float, before: float, after: float, believed: bool
) -> None:
    left = {1: before, 2: after}
    values = {"input_delay": -2000.0, "input_delay pendulum_stribeck": -2000.0 - gain}
    found = named(values, "input_delay", "pendulum_stribeck", left=lambda fit: left[len(fit.plant.effects)], most=2)
    assert found.names == ["input_delay", *(["pendulum_stribeck"] if believed else [])]
    assert (found.refused is None) == believed
    assert found.final.value == pytest.approx(-2000.0 - believed * gain, abs=0.05)


def test_what_leaves_more_than_it_explains_is_looked_for_again_from_other_sizes() -> None:
    """A wrong second effect of 500 nats, and the right one, which only another size finds."""
    values = {
        "input_delay": -2000.0,
        "input_delay pendulum_stribeck": -2500.0,
        "input_delay arm_viscous_drift": [Bowl(-2300.0), Bowl(-2650.0, sizes={"arm_viscous_drift": 3.0})],
    }

    def left(fit: Any) -> float:
        return 600.0 if fit.plant.effect("pendulum_stribeck") else -4.0

    names = ("input_delay", "pendulum_stribeck", "arm_viscous_drift")
    assert named(values, *names, left=left, most=2).names == ["input_delay", "arm_viscous_drift"]
    assert named(values, *names, most=2).names == ["input_delay", "pendulum_stribeck"]


@pytest.mark.parametrize(
    ("most", "names"), [(1, ["base_tilt"]), (3, ["input_offset", "pendulum_encoder_offset", "input_delay"])]
)
def test_two_take_the_place_of_one_and_the_search_goes_on(most: int, names: list[str]) -> None:
    """… unless one effect is all that may be found."""
    both = "input_offset pendulum_encoder_offset"
    values = {
        "base_tilt": -2000.0,
        "input_offset": -1000.0,
        "pendulum_encoder_offset": -900.0,
        both: -2500.0,
        f"{both} input_delay": -4000.0,
    }
    found = named(values, "base_tilt", "input_offset", "pendulum_encoder_offset", "input_delay", most=most)
    assert sorted(found.names) == sorted(names)


def test_what_theta_imitates_is_told_from_the_first_step() -> None:
    from dataclasses import replace

    by = search({"": 0.0, "input_delay": -200.0}, "input_delay", "arm_spring")
    by = replace(by, scorer=replace(by.scorer, absorbed={"arm_spring": 0.999}))  # type: ignore[type-var]
    assert names_found(a_fit(), by).absorbed == {"input_delay": 0.0, "arm_spring": 0.999}


SMALL = {"input_delay": -2000.0, "input_delay arm_presliding": -2080.0}
"""A second effect of four hundredths of the first, as on a rig that has five."""


@pytest.mark.parametrize(
    ("witness", "found"),
    [
        (Told(far_off=False), ["input_delay"]),
        (Told(far_off=False, needed=("arm_presliding",)), ["input_delay"]),  # near enough: its share decides
        (Told(), ["input_delay"]),
        (Told(needed=("arm_presliding",)), ["input_delay", "arm_presliding"]),
    ],
)
def test_far_from_held_out_data_these_decide_and_not_a_share(witness: Told, found: list[str]) -> None:
    assert named(SMALL, "input_delay", "arm_presliding", witness=witness).names == found


@pytest.mark.parametrize(
    ("first", "gain", "off", "found"),
    [
        (2000.0, 300.0, False, ["input_delay"]),
        (2000.0, 300.0, True, ["input_delay", "arm_presliding"]),
        (500.0, 90.0, True, ["input_delay"]),  # the same share, but not much by itself
    ],
)
def test_where_predictions_are_not_adequate_held_out_data_decide_about_a_slight_effect_that_explains_much(
    first: float, gain: float, off: bool, found: list[str]
) -> None:
    """A cable of a seventh of the delay beside it was dropped, as predictions were no longer far off without it."""
    values = {"input_delay": -first, "input_delay arm_presliding": -first - gain}
    witness = Told(far_off=False, a_little_off=off, needed=("arm_presliding",))
    assert named(values, "input_delay", "arm_presliding", witness=witness).names == found


def test_a_small_effect_that_held_out_data_ask_for_stays_when_another_joins() -> None:
    """… and not only until the next step reconsiders it."""
    values = SMALL | {
        "input_dead_zone": -30.0,
        "arm_presliding": -40.0,
        "input_delay input_dead_zone": -2050.0,
        "input_delay arm_presliding input_dead_zone": -2140.0,
    }
    names = ("input_delay", "arm_presliding", "input_dead_zone")
    found = named(values, *names, witness=Told(needed=names))
    assert found.names == list(names)
    assert found.final.value == pytest.approx(-2140.0, abs=0.1)


def test_a_fit_that_joins_is_found_where_no_score_suggests_it() -> None:
    joining = a_fit("input_gain_asymmetry", value=-5000.0)
    values = {"arm_spring": -700.0, "input_gain_asymmetry": [Bowl(-5000.0)]}
    assert named(values, "arm_spring").names == ["arm_spring"]
    assert named(values, "arm_spring", joined={"input_gain_asymmetry": joining}).names == ["input_gain_asymmetry"]


def test_effects_suggested_by_a_score_are_fitted_from_a_joined_fit_only() -> None:
    """Model (5) is far away there, and its θ is no place to start from."""
    joined = {"input_delay": a_fit("input_delay", value=-5000.0)}
    told: list[str] = []
    values = {"arm_spring": -700.0, "input_delay": -5000.0}
    by = replace(search({"": 0.0, **values}, "arm_spring"), progress=told.append)
    found = names_found(a_fit(), by, joined=joined)
    assert found.names == ["input_delay"]
    assert {s.name for s in found.rankings[0]} >= {"arm_spring", "input_delay"}
    at_first = told[1 : told.index("scoring the library (step 2)")]
    assert all("parameters of" in text or "to the end" in text or "without" in text for text in at_first)


CHAIN = {
    "base_tilt": -2000.0,
    "base_tilt input_delay": -2700.0,
    "base_tilt input_delay arm_spring": -5000.0,
    "base_tilt input_delay arm_spring arm_hysteresis": -5420.0,
}


class Wants(Told):
    """Held-out data that are far off, and agree with a model as soon as it has some effect."""

    def __init__(self, name: str):
        self.name = name

    def far(self, fitted: Any) -> bool:
        return True

    def confirms(self, without: Any, fitted: Any) -> bool:
        return fitted.plant.effect(self.name) is not None and without.plant.effect(self.name) is None


def _leaves(fit: Any) -> float:
    """The delay leaves more than it explains, because the spring is still missing."""
    return 800.0 if len(fit.plant.effects) == 2 else 50.0


def test_an_effect_that_leaves_much_stays_where_the_next_ones_justify_it() -> None:
    names = ("base_tilt", "input_delay", "arm_spring")
    assert named(CHAIN, *names, left=_leaves, witness=Wants("arm_spring")).names == list(names)


def test_without_the_agreement_of_held_out_data_it_goes_with_all_that_followed() -> None:
    names = ("base_tilt", "input_delay", "arm_spring")
    found = named(CHAIN, *names, left=lambda fit: 800.0 if len(fit.plant.effects) > 1 else 50.0)
    assert found.names == ["base_tilt"]
    assert found.refused is not None
    assert found.refused.name == "input_delay"


@pytest.mark.parametrize(("gain", "waits"), [(800.0, True), (300.0, False)])
def test_beside_a_very_large_effect_a_smaller_one_waits_where_it_is_not_tiny(gain: float, waits: bool) -> None:
    """A late command of 150 times the noise hides hysteresis of 12 times, of a twelfth of its likelihood."""
    delayed, sprung = "base_tilt input_delay", "base_tilt input_delay arm_spring"
    values = {"base_tilt": -10_000.0, delayed: -10_000.0 - gain, sprung: -10_700.0 - gain}
    left = lambda fit: 900.0 if len(fit.plant.effects) == 2 else 50.0  # noqa: E731
    witness = Wants("arm_spring")
    witness.confirms = lambda without, fitted: fitted.plant.effect("arm_spring") is not None
    found = named(values, *sprung.split(), left=left, witness=witness)
    assert found.names == (sprung.split() if waits else ["base_tilt"])


def test_it_stays_where_the_next_ones_explain_what_it_leaves() -> None:
    names = ("base_tilt", "input_delay", "arm_spring")
    assert named(CHAIN, *names, left=_leaves).names == list(names)


def test_a_chain_ends_before_the_first_effect_that_held_out_data_do_not_ask_for() -> None:
    """The last is small beside the others, and held-out data are as good without it."""
    names = ("base_tilt", "input_delay", "arm_spring", "arm_hysteresis")
    found = named(CHAIN, *names, left=_leaves, witness=Wants("arm_spring"))
    assert found.names == list(names[:3])
    assert found.refused is not None
    assert found.refused.name == "arm_hysteresis"
    assert named(CHAIN, *names, left=_leaves, witness=Wants("arm_hysteresis")).names == list(names)


def test_what_takes_the_place_of_a_look_alike_does_not_only_mend_its_form() -> None:
    """A cable that stiffens is a spring at first; once the spring is superfluous beside it, it is the name."""
    values = {
        "base_tilt": -2000.0,
        "base_tilt arm_spring": -3000.0,
        "base_tilt arm_spring arm_cable": Bowl(-3900.0, 4.0),
        "base_tilt arm_cable": [Bowl(-2990.0), Bowl(-3899.0, 4.0)],
    }

    def of(fit: Any, name: str) -> float:
        return 500.0 if name == "arm_spring" else -20.0

    found = named(values, "base_tilt", "arm_spring", "arm_cable", another_law=of)
    assert found.names == ["base_tilt", "arm_cable"]


def test_an_effect_that_acts_beside_another_is_not_its_equal() -> None:
    """Alone they explain equally much, but of different things: together they explain it all."""
    found = named(
        {"input_delay": -200.0, "arm_spring": -199.0, "arm_spring input_delay": -399.0}, "input_delay", "arm_spring"
    )
    assert sorted(found.names) == ["arm_spring", "input_delay"]
    assert [effect.equals for effect in found.found] == [(), ()]
