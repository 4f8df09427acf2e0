"""What no descent moves: whole numbers and rough sizes."""

from __future__ import annotations

import math

import pytest

from furuta_gym.plant import EFFECTS, TABLE_3, Effect, Plant
from identification.diagnosis.naming.discrete import starts_of, stepped
from identification.diagnosis.naming.fits import repeating, turned_over
from identification.kalman.coordinates import plant_coordinates
from tests.identification.diagnosis.fits import a_fit, search


def valued(plant: Plant, name: str, parameter: str) -> float:
    effect = plant.effect(name)
    assert effect is not None
    return effect.parameters[parameter]


@pytest.mark.parametrize("start", [14.0, 16.0, 17.0, 1.0])
def test_whole_numbers_walk_to_the_best(start: float) -> None:
    def still(plant: Plant) -> float:
        return abs(valued(plant, "arm_ripple", "n") - 16.0)

    by = search({"arm_ripple": 0.0}, still=still)
    fitted = a_fit(Effect("arm_ripple", {"A": 0.5, "n": start, "φ": 0.0}), value=abs(start - 16.0))
    assert valued(stepped(fitted, a_fit(), by).plant, "arm_ripple", "n") == 16.0


def test_what_a_descent_moves_is_not_stepped() -> None:
    spring = a_fit("arm_spring", value=1.0)
    assert stepped(spring, a_fit(), search({"arm_spring": 0.0})) is spring


@pytest.mark.parametrize("start", [0.004, 0.02, 0.047, 0.3])
def test_a_rough_size_walks_to_the_best(start: float) -> None:
    """No descent moves it here: every fit ends at the size where it starts."""

    def still(plant: Plant) -> float:
        return abs(math.log(valued(plant, "arm_backlash", "b") / 0.05))

    fitted = a_fit(Effect("arm_backlash", {"b": start}), value=abs(math.log(start / 0.05)))
    found = stepped(fitted, a_fit(), search({"arm_backlash": 0.0}, still=still))
    assert valued(found.plant, "arm_backlash", "b") == pytest.approx(0.05, rel=0.05)  # half of the narrow step


def test_steps_stay_within_bounds() -> None:
    b = EFFECTS["arm_backlash"].parameters[0]
    by = search({"arm_backlash": 0.0}, still=lambda plant: -valued(plant, "arm_backlash", "b"))
    found = stepped(a_fit(Effect("arm_backlash", {"b": 0.9 * b.upper}), value=-0.9 * b.upper), a_fit(), by)
    assert 0.9 * b.upper <= valued(found.plant, "arm_backlash", "b") <= b.upper


def test_a_rough_size_starts_from_its_whole_grid_and_others_from_their_score() -> None:
    by = search({})
    starts = starts_of(Effect("arm_backlash", {"b": 0.013}), a_fit(), by)
    b = EFFECTS["arm_backlash"].parameters[0]
    assert isinstance(b.grid, tuple)
    sizes = sorted(valued(start.plant, "arm_backlash", "b") for start in starts)
    assert sizes == pytest.approx(sorted([0.013, *b.grid]))
    assert {start.effect for start in starts} == {"arm_backlash"}
    (only,) = starts_of(TABLE_3.default_effect("input_delay"), a_fit(), by)
    assert only.effect == "input_delay"
    assert only.plant.effects == (TABLE_3.default_effect("input_delay"),)


def test_what_repeats_must_repeat_within_the_log() -> None:
    """A third of a period is a drift: no log of its length says that it ever comes back."""
    plant = TABLE_3.with_effects(TABLE_3.default_effect("periodic_torque"))
    kept = {c.name: repeating(c, 20.0, 2.0) for c in plant_coordinates(plant)}
    assert kept["periodic_torque.f"].low == pytest.approx(0.1)  # two periods
    for c in plant_coordinates(plant):
        if c.name != "periodic_torque.f":
            assert kept[c.name] == c


def test_a_stribeck_speed_stays_where_friction_has_turned_over() -> None:
    """Below 3/r any curve of friction is another sharpness: of its own joint."""
    speeds = [f"{joint}_stribeck.vs" for joint in ("arm", "pendulum")]
    plant = TABLE_3.with_effects(*(TABLE_3.default_effect(speed.partition(".")[0]) for speed in speeds))
    sharper = plant.with_effects(Effect("friction_sharpness", {"r1": 1e4, "r2": 150.0}))
    for rig, lows in ((plant, (0.03, 0.03)), (sharper, (0.01, 0.02))):  # the library's own bound is 0.01
        kept = {c.name: turned_over(c, rig, 3.0) for c in plant_coordinates(rig)}
        assert [kept[speed].low for speed in speeds] == pytest.approx(lows)
        assert all(kept[c.name] == c for c in plant_coordinates(rig) if c.name not in speeds)
