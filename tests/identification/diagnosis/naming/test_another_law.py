"""Forward selection where an effect may only describe the law of another one."""

from __future__ import annotations

import math
from typing import Any

import pytest

from identification.diagnosis.naming.next_effect import with_law
from tests.identification.diagnosis.fits import PER_PARAMETER, Told, named


@pytest.mark.parametrize(
    ("drift", "periodic", "found"),
    [
        (300.0, 40.0, ["arm_friction_drift"]),  # another course of the drift would explain as much
        (300.0, 400.0, None),  # more than half, and yet less than what goes with a frequency
        (150.0, 40.0, None),  # less than half
        (math.nan, math.nan, None),
    ],
)
def test_what_goes_with_the_variables_of_an_effect_is_another_law_of_it(
    drift: float, periodic: float, found: list[str] | None
) -> None:
    both = ["arm_friction_drift", "periodic_torque"]
    values = {"arm_friction_drift": -2000.0, " ".join(both): -2500.0}
    of = {"arm_friction_drift": drift, "periodic_torque": periodic}

    def law(fit: Any, name: str) -> float:
        return of[name] if len(fit.plant.effects) < 2 else 0.0

    got = named(values, *both, another_law=law, witness=Told(needed=()))
    assert got.names == (found or both)
    assert (got.refused is None) == (found is None)
    asked_for = named(values, *both, another_law=law, witness=Told(needed=tuple(both)))
    assert asked_for.names == both  # held-out data ask for it: in the plant, and no name
    assert [s.name for s in asked_for.own] == (found or both)
    assert asked_for.laws == ({} if found is None else {"periodic_torque": "arm_friction_drift"})


def test_the_law_of_one_that_stayed_is_asked_also_where_another_went() -> None:
    """A ripple is found first, then a tilt; the ripple goes. What came last may be the tilt's law."""
    values = {
        "arm_ripple": -1000.0,
        "base_tilt": -900.0,
        "arm_ripple base_tilt": -3000.0,
        "base_tilt input_dead_zone": -3400.0,
        "arm_ripple base_tilt input_dead_zone": -3405.0,
    }
    names = ["arm_ripple", "base_tilt", "input_dead_zone"]

    def another_law(fit: Any, name: str) -> float:
        carried = {e.name for e in fit.plant.effects}
        gone = {"arm_ripple", "input_dead_zone"} & carried  # either of them takes it up
        return 0.0 if gone else {"base_tilt": 2400.0}.get(name, 0.0)

    free = named(values, *names, another_law=lambda *_: 0.0)
    assert sorted(free.names) == ["base_tilt", "input_dead_zone"]
    found = named(values, *names, another_law=another_law)
    assert "input_dead_zone" not in found.names


@pytest.mark.parametrize(
    ("law", "net", "believed"), [(5.0, 150.0, True), (-40.0, 150.0, True), (40.0, 150.0, False), (5.0, 20.0, False)]
)
def test_a_small_effect_that_has_nothing_to_do_with_the_law_of_the_large_one_is_found(
    law: float, net: float, believed: bool
) -> None:
    """A dead zone beside a tilt of twenty times its likelihood; what the tilt's law misses would look like a tilt."""
    values = {"base_tilt": -3000.0, "base_tilt input_dead_zone": -3000.0 - net - PER_PARAMETER}
    found = named(values, "base_tilt", "input_dead_zone", another_law=lambda fit, name: law)
    assert found.names == ["base_tilt", *(["input_dead_zone"] if believed else [])]


@pytest.mark.parametrize(("law", "kept"), [(-5.0, True), (30.0, False)])
def test_a_small_effect_stays_when_another_small_one_joins(law: float, kept: bool) -> None:
    """Each is reconsidered beside the others, by the same question that let it in."""
    values = {
        "base_tilt": -3000.0,
        "base_tilt input_dead_zone": -3180.0,
        "base_tilt arm_hysteresis": -3130.0,
        "base_tilt input_dead_zone arm_hysteresis": -3400.0,
    }
    names = ["base_tilt", "input_dead_zone", "arm_hysteresis"]
    found = named(values, *names, another_law=lambda fit, name: law)
    assert found.names == (names if kept else names[:1])


@pytest.mark.parametrize(("taken_up", "kept"), [(0.0, True), (300.0, False)])
def test_what_two_small_effects_have_in_common_counts_against_neither_beside_a_large_one(
    taken_up: float, kept: bool
) -> None:
    """A strong tilt, a late command and friction that remembers, and a cable that is not in the library here: what the
    cable pulls goes with the tilt's variables all along. Each of the two takes up a little of what the other leaves."""
    values = {
        "base_tilt": -20000.0,
        "base_tilt input_delay": -20600.0,
        "base_tilt arm_hysteresis": -20800.0,
        "input_delay arm_hysteresis": -3000.0,
        "base_tilt input_delay arm_hysteresis": -22500.0,
    }
    names = ["base_tilt", "arm_hysteresis", "input_delay"]

    def another_law(fit: Any, name: str) -> float:
        others = {e.name for e in fit.plant.effects} - {name}
        if name == "base_tilt":
            return 900.0 - taken_up * len(others)
        return 300.0 if len(others) < 2 else 0.0

    found = named(values, *names, another_law=another_law, witness=Told())
    assert sorted(found.names) == (sorted(names) if kept else ["base_tilt"])


@pytest.mark.parametrize(("gain", "own"), [(760.0, ["actuator_lag"]), (1300.0, ["actuator_lag", "input_delay"])])
def test_a_lesser_look_alike_in_the_same_variables_is_in_the_plant_without_a_name(gain: float, own: list[str]) -> None:
    """A motor of two lags was called a lag and a delay: held-out data ask for the delay, and cannot say what it is."""
    both = ["actuator_lag", "input_delay"]
    values = {"actuator_lag": -2000.0, " ".join(both): -2000.0 - gain}
    found = named(values, *both, witness=Told(needed=tuple(both)))
    assert found.names == both
    assert [s.name for s in found.own] == own


def test_what_a_law_describes_is_an_effect_of_its_own() -> None:
    assert with_law({}, "b", "a") == {"b": "a"}
    assert with_law({"b": "a"}, "c", "b") == {"b": "a", "c": "a"}
    assert with_law({"b": "a"}, "a", "b") == {"a": "b"}  # a was dropped and came back beside b
