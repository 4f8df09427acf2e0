"""The rule for the integration step: friction stays resolved, sharp or not, on a heavy arm or a light one."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from furuta_gym.plant import QUBE, TABLE_3, Effect, Plant
from furuta_gym.plant.integration_step import (
    SHORTEST_FITTED,
    fitted_step,
    friction_rate,
    response_rate,
    rest_slopes,
    substep,
)
from tests.furuta_gym.plant.helpers import reference_run, run, square_waves
from tests.furuta_gym.plant.strategies import thetas

COUNT = 2 * np.pi / 4096
# an arm so light that friction stops it within 0.2 ms, as a small servo turns it
LIGHT_ARM = QUBE.replace(theta=[0.0108, 0.0102, 0.00836, 0.0141, 0.861, 0.0283, 0.00389, 0.306, 0.00343])


def worst_error(plant, step):
    """Of the angles [rad] over 0.4 s under square waves, from five starts."""
    t_u, rng, worst = np.arange(200) * 0.002, np.random.default_rng(11), 0.0
    for _ in range(5):
        u = rng.uniform(0.3, 1.0) * square_waves(t_u + rng.uniform(0, 1))
        x0 = rng.normal(size=4) * [0.1, 0.05, 0.3, 0.3]
        error = run(plant, x0, t_u, u, 0.4, step) - reference_run(plant, x0, t_u, u, 0.4, rtol=1e-9, atol=1e-10)
        worst = max(worst, np.abs(error[:, :2]).max())
    return worst


@pytest.mark.parametrize("r", [30.0, 100.0, 300.0, 1000.0])
def test_step_rule_keeps_friction_resolved(r):
    """`substep` promises less than a tenth of a 4096-count encoder's noise over 0.4 s."""
    plant, allowed = TABLE_3.replace(friction_sharpness=r), 0.1 * COUNT / np.sqrt(12)
    h = substep(r, plant.friction_rate, 0.002)
    worst = worst_error(plant, h)
    assert worst < allowed, f"{worst:.2e} rad at a step of {1e3 * h:.2f} ms, allowed {allowed:.2e}"


def test_step_rule_keeps_the_friction_of_a_light_arm_resolved():
    """A fifth of a count at worst: near upright a pendulum magnifies every error."""
    h = substep(100.0, LIGHT_ARM.friction_rate, 0.002)
    assert worst_error(LIGHT_ARM, h) < 0.2 * COUNT
    assert worst_error(LIGHT_ARM, substep(100.0, 0.0, 0.002)) > COUNT  # what the sharpness alone would allow


def test_substep_is_bounded_and_falls_with_sharpness():
    steps = [substep(r, 0.0, 0.004) for r in (0.0, 1.0, 10.0, 100.0, 1000.0, 1e6)]
    assert steps[0] == steps[1] == 0.004
    assert np.all(np.diff(steps) <= 0)
    assert 0 < steps[-1] < steps[3] <= 1e-3


def rate_by_numpy(plant: Plant, level1: float = 0.0, level2: float = 0.0) -> float:
    """The largest eigenvalue of M⁻¹ (F_v + F_c r) upright, with so much more dry friction in each joint."""
    theta, (r1, r2) = plant.theta, plant.sharpness
    mass = np.array([[theta[0], theta[2]], [theta[2], theta[3]]])
    slope = np.diag([theta[5] + (theta[7] + level1) * r1, theta[6] + (theta[8] + level2) * r2])
    return float(np.linalg.eigvals(np.linalg.solve(mass, slope)).real.max())


@given(thetas(), st.floats(1.0, 1000.0), st.floats(1.0, 1000.0))
def test_friction_rate_is_the_largest_eigenvalue(theta, r1, r2):
    plant = TABLE_3.replace(theta=theta, friction_sharpness=(r1, r2))
    assert plant.friction_rate == pytest.approx(rate_by_numpy(plant), rel=1e-4, abs=1e-4)


@pytest.mark.parametrize(
    ("effect", "level1", "level2"),
    [
        (Effect("arm_stribeck", {"ΔF": 0.9, "vs": 0.3}), 0.9, 0.0),
        (Effect("pendulum_stribeck", {"ΔF": 0.02, "vs": 0.3}), 0.0, 0.02),
        (Effect("arm_coulomb_asymmetry", {"a": -0.05}), 0.05, 0.0),
    ],
)
def test_friction_of_effects_counts(effect, level1, level2):
    """In the direction in which there is more of it."""
    assert QUBE.with_effects(effect).friction_rate == pytest.approx(rate_by_numpy(QUBE, level1, level2), rel=1e-3)


def test_another_sharpness_counts():
    sharp = QUBE.with_effects(Effect("friction_sharpness", {"r1": 250.0, "r2": 40.0}))
    assert sharp.friction_rate == pytest.approx(rate_by_numpy(QUBE.replace(friction_sharpness=(250.0, 40.0))), rel=1e-3)


@pytest.mark.parametrize("strength", [3.0, 25.0])
def test_step_rule_keeps_friction_near_standstill_resolved(strength):
    """Friction of an effect is as stiff as that of model (5)."""
    stribeck = Effect("arm_stribeck", {"ΔF": strength * QUBE.theta[7], "vs": 0.3})
    plant = QUBE.with_effects(stribeck)
    h = substep(100.0, plant.friction_rate, 0.002)
    assert worst_error(plant, h) < 0.2 * COUNT


@given(st.floats(0.0, 1e5))
def test_a_first_look_takes_longer_steps_that_are_stable(rate):
    step, coarse = (fitted_step(rate, 0.0, coarser) for coarser in (1.0, 4.0))
    assert step <= coarse <= 4.0 * step
    assert coarse * rate < 2.78 or coarse == SHORTEST_FITTED  # never shorter, whatever a fit tries


@pytest.mark.parametrize("stiffness", [30.0, 300.0, 1e4])
def test_a_first_look_follows_the_stiffest_bristle(stiffness):
    """Samples of 10 ms leave room for steps at which Runge–Kutta would leave all bounds."""
    plant = QUBE.with_effects(Effect("arm_presliding", {"σ0": stiffness * QUBE.theta[7]}))
    t_u = np.arange(40) * 0.01
    u, x0 = 0.8 * QUBE.u_max * square_waves(t_u), np.array([0.0, np.pi, 0.0, 0.0])
    longest = fitted_step(plant.friction_rate, 0.0, 10.0)
    apart = run(plant, x0, t_u, u, 0.4, longest) - run(plant, x0, t_u, u, 0.4, 1e-5)
    assert np.abs(apart[:, :2]).max() < 0.02  # of some radians


@pytest.mark.parametrize("lost", [0.0, np.nan])
def test_a_fit_that_went_astray_still_ends(lost):
    """θ1 θ4 = θ3²: no inertia is left upright."""
    p = np.array([1.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0 + lost, 1.0, 100.0, 100.0])
    slopes = rest_slopes(p, np.empty((0, 3), dtype=np.int64), 4)
    assert fitted_step(friction_rate(slopes, 1.0, 1.0), 0.0, 2.0) == SHORTEST_FITTED


@pytest.mark.parametrize("T", [1e-4, 3.8e-4, 2e-3, 0.05])
def test_the_time_of_a_lag_is_found(T):
    p, codes, rows = QUBE.with_effects(Effect("actuator_lag", {"T": T})).packed()
    assert response_rate(p, codes, rows) == pytest.approx(1.0 / T, rel=1e-6)


@pytest.mark.parametrize("effects", [(), (Effect("actuator_lag", {"T": 0.0}),), (Effect("input_delay", {"d": 0.003}),)])
def test_a_command_that_acts_at_once_has_no_time(effects):
    assert response_rate(*QUBE.with_effects(*effects).packed()) == 0.0


@pytest.mark.parametrize("T", [2e-4, 3.8e-4, 1e-3, 5e-3])
def test_a_step_of_a_fit_resolves_a_lag(T):
    """The motion of a tenth of a second differs by as much as a lag a fiftieth longer would make, at most."""
    step = fitted_step(0.0, 1.0 / T, 2.0)
    t_u = np.arange(50) * 0.002
    u, x0 = square_waves(t_u), np.array([0.0, np.pi, 0.0, 0.0])
    smooth = QUBE.replace(theta=[*QUBE.theta[:7], 0.0, 0.0])
    plants = [smooth.with_effects(Effect("actuator_lag", {"T": time})) for time in (T, 1.02 * T)]
    fine, longer = (run(plant, x0, t_u, u, 0.1, 1e-5) for plant in plants)
    apart = np.abs(run(plants[0], x0, t_u, u, 0.1, step) - fine)[:, 0].max()
    assert apart < np.abs(longer - fine)[:, 0].max()
