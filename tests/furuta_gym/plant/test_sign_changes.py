"""Steps across a change of friction's sign: as exact as very short ones, and few."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from furuta_gym.plant import QUBE, Effect
from furuta_gym.plant.advance import workspace
from furuta_gym.plant.integration_step import LONGEST_FITTED, fitted_step, moving_step
from furuta_gym.plant.sign_changes import advance_alike, passage

T, SAMPLES = 0.002, 1000
EFFECTS = {
    "none": (),
    "stribeck": (Effect("arm_stribeck", {"ΔF": 0.5 * QUBE.theta[7], "vs": 0.3}),),
    "asymmetry": (Effect("pendulum_coulomb_asymmetry", {"a": 0.3 * QUBE.theta[8]}),),
    "late": (Effect("input_delay", {"d": 0.0031}),),
    "cable": (Effect("arm_cable", {"k": 0.2, "q1n": 0.3, "k3": 0.1}),),
}


def chirp(t):
    return 3.0 * np.sin(2.0 * np.pi * (0.5 + 2.0 * t) * t)


def pulses(t):
    """With pauses in which the arm stops."""
    return 2.0 * np.sign(np.sin(2.0 * np.pi * 1.3 * t)) * (np.sin(2.0 * np.pi * 2.6 * t) > 0.0)


def swing(plant, step, r=100.0, aside=0.0, moving=0.0, command=chirp):
    """Angles and speeds (SAMPLES, 4) of a pendulum that a command swings, in one lane of eight; lane 0 moves a bit
    `aside` [rad/s]. moving [s]: steps where friction is constant, at least `step`."""
    plant = plant.replace(friction_sharpness=r)
    p, codes, rows = plant.packed()
    lanes = 8
    P, W = np.repeat(p[:, None], lanes, axis=1), np.zeros((2, lanes))
    X = np.zeros((rows, lanes))
    X[1] = np.pi
    X[2, 0] += aside
    t = T * np.arange(SAMPLES)
    U = command(t)[:, None]
    space, kept, found = workspace(rows, lanes), np.empty((rows, lanes)), np.empty((SAMPLES, 4))
    plain = not plant.effects
    for k in range(SAMPLES):
        advance_alike(X, t[k], t[k] + T, t, U, k, W, P, codes, step, moving, r, r, plain, kept, *space)
        found[k] = X[:4, 1]
    return found


@pytest.mark.parametrize("r", [20.0, 100.0, 300.0])
@pytest.mark.parametrize("name", EFFECTS)
def test_long_steps_agree_with_very_short_ones(name, r):
    """To 0.005 counts of a 2048-count encoder over two seconds; at r = 100 equal steps of 1 ms are 0.03 to 0.09 off."""
    plant = QUBE.with_effects(*EFFECTS[name])
    apart = swing(plant, LONGEST_FITTED, r) - swing(plant, 1e-5, r)
    assert np.abs(apart[:, :2]).max() < 0.005 * 2.0 * np.pi / 2048


@pytest.mark.parametrize("command", [chirp, pulses])
@pytest.mark.parametrize("r", [300.0, 1e3, 1e4])
@pytest.mark.parametrize("name", ["none", "stribeck", "late"])
def test_steps_are_long_where_hard_friction_is_constant_and_as_exact(name, r, command):
    """Near rest the friction's rate bounds them. To 0.002 counts of a 2048-count encoder."""
    plant = QUBE.with_effects(*EFFECTS[name]).replace(friction_sharpness=r)
    step = fitted_step(plant.friction_rate, 0.0, 1.0)
    assert step < 0.5 * LONGEST_FITTED
    apart = swing(plant, step, r, moving=LONGEST_FITTED, command=command) - swing(plant, step, r, command=command)
    assert 0.0 < np.abs(apart[:, :2]).max() < 0.002 * 2.0 * np.pi / 2048


@pytest.mark.parametrize("r", [30.0, 1e3])
def test_where_both_joints_move_viscous_friction_bounds_the_step(r):
    theta = QUBE.theta.copy()
    theta[5] *= 1e3
    plant = QUBE.replace(theta=theta, friction_sharpness=r)
    smooth = plant.replace(theta=[*theta[:7], 0.0, 0.0])
    step = moving_step(*plant.packed(), r, r, 0.0, 1.0)
    assert step == pytest.approx(fitted_step(smooth.friction_rate, 0.0, 1.0), rel=0.01)
    assert fitted_step(plant.friction_rate, 0.0, 1.0) < 0.95 * step < 0.95 * LONGEST_FITTED


def test_lanes_that_move_nearly_alike_are_as_exact():
    plant = QUBE
    apart = swing(plant, LONGEST_FITTED, aside=1e-3) - swing(plant, 1e-5)
    assert np.abs(apart[:, :2]).max() < 0.02 * 2.0 * np.pi / 2048


@given(st.floats(-30.0, 30.0), st.floats(-30.0, 30.0), st.floats(1.0, 1000.0), st.integers(1, 4))
def test_a_passage_holds_where_friction_turns_over(before, after, r, steps):
    begin, end, step = passage(before, after, r, steps)
    if begin >= end:
        inside = np.linspace(before, after, 1001)
        turning = np.abs(r * inside) < 3.0
        assert not turning.any() or r * abs(after - before) <= 0.5 * steps * (1.0 + 1e-12)
        return
    assert 0.0 <= begin < end <= 1.0
    assert r * abs(after - before) * step == pytest.approx(0.5)
    for part in np.linspace(0.0, 1.0, 101):
        if abs(r * (before + part * (after - before))) < 3.0:
            assert begin <= part <= end
