"""Where effects start whose laws include one another: a spring, a cable that stiffens, a cable that comes taut."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from furuta_gym.plant import EFFECTS, TABLE_3, Effect, Plant
from identification.diagnosis.naming.fits import FitRequest
from identification.diagnosis.naming.multistart import from_best
from identification.diagnosis.naming.related import angles_of, in_place_of_friction, nearest, related
from identification.diagnosis.policy import DecisionPolicy
from tests.identification.diagnosis.fits import RECORD, a_fit, search

ANGLES = np.linspace(-0.7, 0.4, 50)
stiffnesses, places = st.floats(0.01, 5.0), st.floats(-2.0, 2.0)


def torques(effect: Effect) -> np.ndarray:
    p, kernel = effect.parameters, EFFECTS[effect.name].kernels["torque"]
    return np.array([kernel(q1, **p)[0] for q1 in ANGLES])


def spring(k: float = 0.3, q1n: float = 0.1) -> Effect:
    return Effect("arm_spring", {"k": k, "q1n": q1n})


def cable(k: float, q1n: float, k3: float, q1s: float) -> Effect:
    return Effect("arm_cable", {"k": k, "q1n": q1n, "k3": k3, "q1s": q1s})


def test_who_is_related() -> None:
    of_angle = ("arm_spring", "arm_cable", "arm_taut_cable")
    assert all(related(one, other) for one in of_angle for other in of_angle if one != other)
    assert not related("arm_spring", "arm_spring")
    assert not any(related(name, other) for name in EFFECTS if name not in of_angle for other in EFFECTS)


@given(k=stiffnesses, q1n=places)
@pytest.mark.parametrize("name", ["arm_cable", "arm_taut_cable"])
def test_a_cable_that_is_a_spring_is_found_exactly(name: str, k: float, q1n: float) -> None:
    own = spring(k, q1n)
    found = nearest(own, TABLE_3.default_effect(name), ANGLES)
    assert torques(found) == pytest.approx(torques(own), rel=1e-9, abs=1e-9)


@given(k=stiffnesses, q1n=places, k3=st.floats(0.0, 1.0), q1s=places)
def test_the_spring_nearest_to_a_cable_is_the_line_through_its_torque(
    k: float, q1n: float, k3: float, q1s: float
) -> None:
    own = cable(k, q1n, k3, q1s)
    slope, level = np.polyfit(ANGLES, torques(own), 1)
    found = nearest(own, spring(), ANGLES)
    line = slope * ANGLES + level
    if abs(level / slope) > 20.0:  # no spring has its rest so far away
        return
    assert torques(found) == pytest.approx(line, abs=1e-3 * float(np.std(line)))


def test_a_cable_of_another_kind_is_nearer_than_any_spring() -> None:
    taut = Effect("arm_taut_cable", {"k1": 0.1, "k2": 0.9, "q1n": -0.3, "qt": 0.0})
    for own, start in ((taut, TABLE_3.default_effect("arm_cable")), (cable(0.1, -0.3, 0.9, -0.6), taut)):
        off = [float(np.sum((torques(nearest(own, other, ANGLES)) - torques(own)) ** 2)) for other in (start, spring())]
        assert off[0] < 0.3 * off[1]


def test_angles_are_counted_from_the_zero_of_their_log() -> None:
    plain, moved = (angles_of((RECORD, RECORD), {0: (zero, 0.0)}) for zero in (0.0, 0.2))
    assert moved == pytest.approx(plain - 0.2)
    assert plain[0] == pytest.approx(RECORD.y[:, 0].min())
    assert plain[-1] == pytest.approx(RECORD.y[:, 0].max())


@pytest.mark.parametrize(("best", "lost"), [("arm_cable", "arm_spring"), ("arm_spring", "arm_cable")])
def test_a_special_case_and_what_includes_it_find_each_other(best: str, lost: str) -> None:
    """A fit that ended far from where a related one is goes on from there: no spring is worse than a cable that does
    not stiffen, and no cable than a spring."""
    truth = torques(spring())

    def stays(request: FitRequest) -> Any:
        """A fit from which no descent leads away."""
        (effect,) = request.plant.effects
        return a_fit(effect, value=400.0 * float(np.mean((torques(effect) - truth) ** 2) > 1e-4))

    setting = replace(search({"": 1000.0}), fitter=stays)
    at = {"arm_spring": spring(), "arm_cable": cable(0.3, 0.1, 0.0, -0.5)}
    far = {"arm_spring": spring(2.0, 1.5), "arm_cable": cable(2.0, 1.5, 0.3, -3.0)}
    fits = {best: a_fit(at[best], value=0.0), lost: a_fit(far[lost], value=400.0)}
    found = from_best(best, {lost: far[lost]}, fits, a_fit(value=1000.0), setting)
    assert found[lost].value < 1.0


def test_a_law_that_is_constant_at_these_angles_has_no_nearest_one() -> None:
    """A cable that comes taut beyond the arm's travel: whatever is looked for stays where it was."""
    angles = np.linspace(-0.2, 0.3, 60)
    slack = Effect("arm_taut_cable", {"k1": 5e-21, "k2": 0.004, "q1n": 13.6, "qt": 5.7})
    start = cable(0.1, 1.9, 0.005, 0.06)
    assert nearest(slack, start, angles) is start
    assert nearest(cable(0.0, 0.0, 0.0, 0.0), spring(), angles) == spring()


@settings(max_examples=25)
@given(
    st.sampled_from([0.0, 1e-300, 1e-21, 1e-9, 0.1]),
    st.sampled_from([0.0, 1e-21, 0.004, 3.0]),
    st.floats(-20.0, 20.0),
    st.floats(-6.0, 6.0),
    st.sampled_from(["arm_cable", "arm_spring"]),
)
def test_any_taut_cable_has_a_related_law_within_its_bounds(
    k1: float, k2: float, q1n: float, qt: float, name: str
) -> None:
    taut = Effect("arm_taut_cable", {"k1": k1, "k2": k2, "q1n": q1n, "qt": qt})
    found = nearest(taut, TABLE_3.default_effect(name), np.linspace(-0.3, 0.25, 60))
    assert found.name == name
    assert all(p.lower <= found.parameters[p.name] <= p.upper for p in found.type.parameters)


STOPS = {"κ": 2.0, "d": 0.05, "κ2": 1.0, "d2": 0.03}


def with_stops(theta8: float, **more: float) -> Plant:
    theta = [*TABLE_3.theta[:7], theta8, TABLE_3.theta[8]]
    lag = Effect("actuator_lag", {"T": 0.01})
    return TABLE_3.replace(theta=theta).with_effects(Effect("arm_hysteresis", {**STOPS, **more}), lag)


@pytest.mark.parametrize(("theta8", "taken"), [(0.0, True), (0.01, True), (0.02, False), (0.13, False)])
def test_a_hysteresis_without_coulomb_friction_beside_it_is_an_arm_that_gives(theta8: float, taken: bool) -> None:
    """Its stops slip at 0.13 V together."""
    found = in_place_of_friction(with_stops(theta8), "arm_hysteresis", "arm_presliding", DecisionPolicy())
    assert (found is not None) == taken
    if found is not None:
        assert found.theta[7] == pytest.approx(theta8 + 0.13)
        assert [e.name for e in found.effects] == ["actuator_lag", "arm_presliding"]
        assert found.effects[1].parameters["σ0"] == 3.0
        assert 0.0 < found.effects[1].parameters["i"] < 1.0


def test_nothing_else_is_friction() -> None:
    plant = with_stops(0.0)
    others = [(a, b) for a in ("actuator_lag", "arm_hysteresis", "arm_spring") for b in EFFECTS]
    others.remove(("arm_hysteresis", "arm_presliding"))
    assert all(in_place_of_friction(plant, a, b, DecisionPolicy()) is None for a, b in others)


def test_such_a_bristle_starts_from_the_best_fit() -> None:
    """A rival that ended far away goes on from where the hysteresis, which is it, is."""
    current = a_fit(value=1000.0)
    stops = Effect("arm_hysteresis", STOPS)
    best = replace(a_fit(stops, value=0.0), plant=TABLE_3.replace(theta=with_stops(0.0).theta).with_effects(stops))
    far = Effect("arm_presliding", {"σ0": 500.0})

    def stays(request: FitRequest) -> Any:
        plant = request.plant
        (effect,) = plant.effects
        there = effect.parameters["i"] < 1.0 and plant.theta[7] == pytest.approx(0.13)
        return replace(a_fit(effect, value=-5.0 if there else 400.0), plant=plant)

    fits = {"arm_hysteresis": best, "arm_presliding": a_fit(far, value=400.0)}
    found = from_best(
        "arm_hysteresis", {"arm_presliding": far}, fits, current, replace(search({"": 1000.0}), fitter=stays)
    )
    assert found["arm_presliding"].value == -5.0
