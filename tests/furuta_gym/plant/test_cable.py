"""Cables and friction that remembers: what their definitions promise, for any parameters."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from furuta_gym.plant import LARGE_RIG, TABLE_3, Effect
from furuta_gym.plant.effects.library import EFFECTS
from tests.furuta_gym.plant.helpers import derivative, run

TH = LARGE_RIG.theta
places = st.floats(-6.0, 6.0)
stiffnesses = st.floats(0.0, 5.0)
cables = st.one_of(
    st.fixed_dictionaries({"k": stiffnesses, "q1n": places, "k3": stiffnesses, "q1s": places}).map(
        lambda p: Effect("arm_cable", p)
    ),
    st.fixed_dictionaries({"k1": stiffnesses, "k2": stiffnesses, "q1n": places, "qt": places}).map(
        lambda p: Effect("arm_taut_cable", p)
    ),
)


def torque(effect: Effect, q1: float) -> float:
    """The effect's torque on the arm of the large rig at rest, from its acceleration."""
    bare = LARGE_RIG.replace(theta=[*TH[:5], 0, 0, 0, 0])
    x = [q1, math.pi / 2, 0.0, 0.0]  # no coupling of the rows there: M12 = θ3 cos q2
    difference = derivative(bare.with_effects(effect), x, 0.0)[2] - derivative(bare, x, 0.0)[2]
    return float(difference * (TH[0] + TH[1]))


@given(effect=cables, a=places, b=places)
def test_a_cable_only_ever_pulls_back_and_harder_the_further(effect, a, b):
    low, high = min(a, b), max(a, b)
    slack = 1e-9 * (1.0 + abs(torque(effect, low)) + abs(torque(effect, high)))
    assert torque(effect, low) >= torque(effect, high) - slack


@given(effect=cables)
def test_a_cable_has_no_torque_at_its_neutral_angle(effect):
    assert torque(effect, effect.parameters["q1n"]) == pytest.approx(0.0, abs=1e-9)


@given(effect=cables, q1=places)
def test_a_cable_is_linear_in_its_coefficients(effect, q1):
    p = effect.parameters
    c = effect.type.coefficients(p)
    if effect.name == "arm_cable":
        functions = [1.0, q1, q1**2, q1**3]
        assert c[3] <= 0.0
        assert c[2] ** 2 <= 3.0 * c[1] * c[3] * (1 + 1e-9) + 1e-12
    else:
        functions = [1.0, min(q1 - p["qt"], 0.0), max(q1 - p["qt"], 0.0)]
    assert np.dot(c, functions) == pytest.approx(torque(effect, q1), abs=1e-7, rel=1e-7)


@given(effect=cables, k=stiffnesses, q1n=places, q1=places)
def test_a_cable_takes_a_spring_in(effect, k, q1n, q1):
    """Both together are a cable of the same kind, with the same torque everywhere."""
    spring = Effect("arm_spring", {"k": k, "q1n": q1n})
    one = Effect(effect.name, effect.type.includes["arm_spring"](spring.parameters, effect.parameters))
    both = torque(effect, q1) + torque(spring, q1)
    assert torque(one, q1) == pytest.approx(both, rel=1e-6, abs=1e-4)


def test_a_spring_is_a_cable_of_either_kind():
    for q1 in (-2.0, 0.1, 3.0):
        spring = torque(Effect("arm_spring", {"k": 0.3, "q1n": -0.5}), q1)
        assert torque(Effect("arm_cable", {"k": 0.3, "q1n": -0.5}), q1) == pytest.approx(spring)
        taut = Effect("arm_taut_cable", {"k1": 0.3, "k2": 0.3, "q1n": -0.5, "qt": 1.0})
        assert torque(taut, q1) == pytest.approx(spring)


def test_a_slack_cable_does_nothing_on_its_slack_side():
    taut = Effect("arm_taut_cable", {"k1": 0.0, "k2": 0.7, "q1n": 0.2, "qt": 0.5})
    assert [torque(taut, q1) for q1 in (-3.0, 0.0, 0.5)] == pytest.approx([0.0, 0.0, 0.0])
    assert torque(taut, 1.5) == pytest.approx(-0.7)


def test_look_alikes_know_each_other():
    alike = {"arm_spring", "arm_cable", "arm_taut_cable", "arm_ripple", "base_tilt"}
    for name in ("arm_cable", "arm_taut_cable"):
        assert set(EFFECTS[name].mistaken_for) == alike - {name}
        assert all(name in EFFECTS[other].mistaken_for for other in alike - {name})


# ---- hysteresis: an arm that is moved along a path ----------------------------------------------------------------


def moved(path, elements, steps: int = 1, ρ: float = 0.0) -> np.ndarray:
    """Torque of the hysteresis (n,) at the points of a path (n,) of the arm from zero on, each stretch in so many
    Runge–Kutta steps. The arm is so heavy that only its speed moves it."""
    (κ, d), (κ2, d2) = elements
    effect = Effect("arm_hysteresis", {"κ": κ, "d": d, "κ2": κ2, "d2": d2, "ρ": ρ})
    heavy = TABLE_3.replace(theta=[1e12, 1e-3, 1e-3, 1.0, 1e-9, 0, 0, 0, 0]).with_effects(effect)
    state, torques = np.zeros(6), []
    state[1] = math.pi / 2
    for q1 in path:
        state[2:4] = q1 - state[0], 0.0
        state = run(heavy, state, [0.0], [0.0], 1.0, 1.0 / steps)[-1]
        z, z2 = np.clip(q1 - state[4:], [-d, -d2], [d, d2])
        torques.append(-κ * z - κ2 * z2)
    return np.array(torques)


def stop(path, d) -> np.ndarray:
    """z along a path that starts at zero, from the definition, Δq1 by Δq1."""
    z, found, before = 0.0, [], 0.0
    for q in path:
        z, before = min(max(z + q - before, -d), d), q
        found.append(z)
    return np.array(found)


two = ((2.0, 0.05), (0.4, 0.3))
paths = st.lists(st.floats(-2.0, 2.0), min_size=1, max_size=12)
widths = st.floats(0.01, 1.0)
strengths = st.floats(0.0, 5.0)


@given(path=paths, κ=strengths, d=widths, κ2=strengths, d2=widths, steps=st.sampled_from([1, 2, 7]))
def test_hysteresis_is_the_definitions_for_any_path_and_step(path, κ, d, κ2, d2, steps):
    """A stretch without a reversal ends at the same memory whatever its steps: the stop is exact."""
    expected = -κ * stop(path, d) - κ2 * stop(path, d2)
    np.testing.assert_allclose(moved(path, ((κ, d), (κ2, d2)), steps), expected, atol=1e-9)


@given(path=paths, inner=st.lists(st.floats(0.0, 1.0), max_size=6), d=widths)
def test_a_wider_excursion_wipes_out_what_came_between(path, inner, d):
    """After a turning point only larger ones count: loops inside a stroke leave no trace at its end."""
    low, high = -2.5, 2.5  # wider than all before
    between = [low + 0.5 * share * (high - low) for share in inner]
    direct, detour = ([*path, low, *way, high, 0.3] for way in ([], between))
    elements = ((1.5, d), (0.2, 2 * d))
    np.testing.assert_allclose(moved(direct, elements)[-2:], moved(detour, elements)[-2:], atol=1e-9)


def gradual(path, d, ρ) -> np.ndarray:
    """z along a path that starts at zero: inward it follows, outward 1 − ρ |z|/d decays as exp(−ρ Δ/d)."""
    z, found, before = 0.0, [], 0.0
    for q in path:
        way, before = q - before, q
        side = math.copysign(1.0, way)
        inward = min(abs(way), max(-side * z, 0.0))
        z += side * inward
        if (rest := abs(way) - inward) > 0.0:
            left = (1.0 - ρ * abs(z) / d) * math.exp(-ρ * rest / d)
            z = side * min((1.0 - left) * d / ρ, d)
        found.append(z)
    return np.array(found)


@given(path=paths, κ=strengths, d=widths, d2=widths, ρ=st.floats(0.05, 1.0))
def test_elements_that_yield_gradually_are_the_definitions_for_any_path(path, κ, d, d2, ρ):
    expected = -κ * gradual(path, d, ρ) - 0.4 * gradual(path, d2, ρ)
    steps = math.ceil(20.0 * max(np.abs(np.diff([0.0, *path])).max() / min(d, d2), 1.0))
    np.testing.assert_allclose(moved(path, ((κ, d), (0.4, d2)), steps, ρ), expected, atol=2e-2 * (κ * d + 0.4 * d2))


def test_elements_that_yield_gradually_meet_their_definition_as_steps_shrink():
    path, d = (0.07, -0.02, 0.5, 0.33), 0.1
    expected = -2.0 * gradual(path, d, 0.6)
    far, near = (np.abs(moved(path, ((2.0, d), (0.0, 1.0)), n, 0.6) - expected).max() for n in (20, 400))
    assert near < 0.1 * far
    assert near < 1e-3 * 2.0 * d


@pytest.mark.parametrize(
    ("elements", "low", "high"), [(two, -0.6, 0.6), (two, -0.1, 0.1), (((1.0, 0.2), (0.0, 1.0)), -0.5, 0.1)]
)
def test_a_closed_loop_takes_the_energy_of_its_area(elements, low, high):
    """The area of a stop's loop of width w is 4 κ d (w/2 − d) where w > 2 d, and nothing where it never slips."""
    n = 200
    loop = np.concatenate([np.linspace(high, low, n + 1)[1:], np.linspace(low, high, n + 1)[1:]])
    torques = moved([high, *loop, *loop], elements)[
        -2 * n - 1 :
    ]  # the first loop is not closed: the arm starts at zero
    work = -np.sum(0.5 * (torques[1:] + torques[:-1]) * np.diff([high, *loop]))
    area = sum(4.0 * κ * d * max(0.5 * (high - low) - d, 0.0) for κ, d in elements)
    assert work == pytest.approx(area, rel=1e-3, abs=1e-9)


def test_halving_the_step_moves_a_reversing_arm_by_less_than_a_tenth_of_a_count():
    plant = TABLE_3.with_effects(Effect("arm_hysteresis", {"κ": 2.0, "d": 0.02, "κ2": 0.5, "d2": 0.2}))
    t = np.arange(250) * 0.004
    u = 1.5 * np.sin(2 * np.pi * 2.3 * t)
    coarse, fine = (run(plant, [0.1, math.pi, 0, 0], t, u, 1.0, h) for h in (1e-3, 5e-4))
    assert np.ptp(coarse[:, 0]) > 0.1
    assert np.abs(coarse[:, :2] - fine[:, :2]).max() < 0.1 * 2 * np.pi / 4096
