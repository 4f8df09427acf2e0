"""Steps across a change of friction's sign: as exact as very short ones, and few."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from furuta_gym.plant import QUBE, Effect
from furuta_gym.plant.dynamics import workspace
from furuta_gym.plant.integration_step import LONGEST_FITTED
from furuta_gym.plant.sign_changes import advance_alike, passage

T, SAMPLES = 0.002, 1000
EFFECTS = {
    "none": (),
    "stribeck": (Effect("arm_stribeck", {"ΔF": 0.5 * QUBE.theta[7], "vs": 0.3}),),
    "asymmetry": (Effect("pendulum_coulomb_asymmetry", {"a": 0.3 * QUBE.theta[8]}),),
    "late": (Effect("input_delay", {"d": 0.0031}),),
    "cable": (Effect("arm_cable", {"k": 0.2, "q1n": 0.3, "k3": 0.1}),),
}


def swing(plant, step, r=100.0, aside=0.0):
    """Angles and speeds (SAMPLES, 4) of a pendulum that a chirp swings, in one lane of eight; lane 0 moves a bit
    `aside` [rad/s]."""
    plant = plant.replace(friction_sharpness=r)
    p, codes, rows = plant.packed()
    lanes = 8
    P, W = np.repeat(p[:, None], lanes, axis=1), np.zeros((2, lanes))
    X = np.zeros((rows, lanes))
    X[1] = np.pi
    X[2, 0] += aside
    t = T * np.arange(SAMPLES)
    U = 3.0 * np.sin(2.0 * np.pi * (0.5 + 2.0 * t) * t)[:, None]
    space, kept, found = workspace(rows, lanes), np.empty((rows, lanes)), np.empty((SAMPLES, 4))
    plain = not plant.effects
    for k in range(SAMPLES):
        advance_alike(X, t[k], t[k] + T, t, U, k, W, P, codes, step, r, r, plain, kept, *space)
        found[k] = X[:4, 1]
    return found


@pytest.mark.parametrize("r", [20.0, 100.0, 300.0])
@pytest.mark.parametrize("name", EFFECTS)
def test_long_steps_agree_with_very_short_ones(name, r):
    """To 0.005 counts of a 2048-count encoder over two seconds; at r = 100 equal steps of 1 ms are 0.03 to 0.09 off."""
    plant = QUBE.with_effects(*EFFECTS[name])
    apart = swing(plant, LONGEST_FITTED, r) - swing(plant, 1e-5, r)
    assert np.abs(apart[:, :2]).max() < 0.005 * 2.0 * np.pi / 2048


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
