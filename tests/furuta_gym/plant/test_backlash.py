"""Backlash with any share of the inertia on the motor's side."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from furuta_gym.plant import QUBE, TABLE_3, Effect, Plant
from tests.furuta_gym.plant.helpers import derivative, run

THETA = np.array([0.02, 0.004, 0.004, 0.005, 0.15, 0.0, 0.0, 0.0, 0.0])
BARE = Plant(theta=THETA, unit="N·m", u_max=1.0)


def with_play(share: float, b: float = 0.02) -> Plant:
    return BARE.with_effects(Effect("arm_backlash", {"b": b, "rho": share}))


@pytest.mark.parametrize("share", [0.05, 0.1, 0.42])
def test_within_the_play_only_the_rotor_turns(share):
    x = [0.3, math.pi, 0.0, 0.0, 0.0, 0.0]
    rates = np.asarray(derivative(with_play(share), x, 0.05))
    assert rates[2] == pytest.approx(0.0, abs=1e-12)
    assert rates[5] == pytest.approx(0.05 / (share * THETA[0]))


@pytest.mark.parametrize("share", [0.05, 0.42])
def test_a_hit_passes_momentum_on(share):
    """Nothing from outside turns the two bodies: what the rotor loses the arm and the pendulum gain."""
    plant = with_play(share)
    t = np.arange(0.0, 0.4, 0.005)
    states = run(plant, [0.0, math.pi, 0.0, 0.0, 0.0, 2.0], t, np.zeros_like(t), 0.4, 2e-5)
    q2, v1, v2, relative = states[:, 1], states[:, 2], states[:, 3], states[:, 5]
    rotor = share * THETA[0]
    arm = (THETA[0] - rotor + THETA[1] * np.sin(q2) ** 2) * v1 + THETA[2] * np.cos(q2) * v2
    momentum = arm + rotor * (v1 + relative)
    np.testing.assert_allclose(momentum, momentum[0], rtol=1e-6)
    assert np.abs(arm).max() > 0.1 * abs(momentum[0])


@given(share=st.floats(0.001, 0.9), q2=st.floats(-math.pi, math.pi))
def test_no_share_leaves_an_arm_without_inertia(share, q2):
    """The pendulum's weight carries θ3²/θ4 of θ1, which no rotor can have."""
    x = [0.0, q2, 1.0, -1.0, 0.03, 0.5]
    rates = np.asarray(derivative(with_play(share), x, 0.1))
    assert np.isfinite(rates).all()
    pushed = np.asarray(derivative(with_play(share), [*x[:4], 0.05, 0.5], 0.1))
    assert pushed[2] > rates[2]  # a harder push from the rotor turns the arm the same way


@pytest.mark.parametrize("plant", [BARE, QUBE, TABLE_3], ids=["bare", "qube", "table3"])
@pytest.mark.parametrize("share", [0.02, 0.1, 0.45, 0.9])
def test_a_rotor_that_is_pressed_on_its_stop_does_not_chatter(plant, share):
    """In steps of 2.5 ms, the longest of a usual log, whatever the rotor's share."""
    frictionless = plant.replace(theta=[*plant.theta[:5], 0.0, 0.0, 0.0, 0.0], effects=())
    played = frictionless.with_effects(Effect("arm_backlash", {"b": 0.01, "rho": share}))
    t = np.arange(0.0, 0.3, 0.0025)
    push = 0.02 * plant.u_max * np.ones_like(t)
    states = run(played, [0.0, math.pi, 0.0, 0.0, 0.01, 0.0], t, push, 0.3, 2.5e-3)
    fine = run(played, [0.0, math.pi, 0.0, 0.0, 0.01, 0.0], t, push, 0.3, 1e-4)
    speed = np.abs(fine[:, 2]).max()
    assert np.abs(states[60:, 5] - fine[60:, 5]).max() < 0.01 * speed
