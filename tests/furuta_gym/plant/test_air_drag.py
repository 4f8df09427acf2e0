"""Air drag of a pendulum that the arm carries along: the force on a paddle, from the motion of its centre in space."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from furuta_gym.plant import Effect, Plant
from furuta_gym.plant.parameters import pendulum_frequency
from tests.furuta_gym.plant.helpers import derivative, run
from tests.furuta_gym.plant.strategies import angles

ARM, ROD, MASS = 0.2, 0.3, 0.1  # m, m, kg
PADDLE = 0.25  # m, from the joint to the paddle's centre
J1 = 0.004  # kg m²
THETA = np.array([J1 + MASS * ARM**2, MASS * ROD**2 / 3, MASS * ARM * ROD / 2, MASS * ROD**2 / 3, 0.147, 0, 0, 0, 0])
C_AIR = 0.02  # N s²/m²


def centre(q1: float, q2: float) -> np.ndarray:
    """Of the paddle in space [m]: the pendulum swings in the plane across the arm, q2 = 0 upright."""
    along, across = np.array([math.cos(q1), math.sin(q1), 0.0]), np.array([-math.sin(q1), math.cos(q1), 0.0])
    return ARM * along + PADDLE * (math.sin(q2) * across + math.cos(q2) * np.array([0.0, 0.0, 1.0]))


def face(q1: float, q2: float) -> np.ndarray:
    """The paddle's normal: the direction in which the pendulum swings."""
    across = np.array([-math.sin(q1), math.cos(q1), 0.0])
    return math.cos(q2) * across - math.sin(q2) * np.array([0.0, 0.0, 1.0])


def torques(q1: float, q2: float, v1: float, v2: float) -> np.ndarray:
    """Generalised forces (2,) of the air on the paddle, by virtual work."""
    h = 1e-6
    by_q1 = (centre(q1 + h, q2) - centre(q1 - h, q2)) / (2 * h)
    by_q2 = (centre(q1, q2 + h) - centre(q1, q2 - h)) / (2 * h)
    normal = face(q1, q2)
    speed = float(normal @ (by_q1 * v1 + by_q2 * v2))
    force = -C_AIR * speed * abs(speed) * normal
    return np.array([force @ by_q1, force @ by_q2])


def with_paddle() -> tuple[Plant, Plant]:
    """The rig without air and with it. ℓ³ C is what the air takes at the pendulum, and L1/ℓ the arm's lever."""
    bare = Plant(theta=THETA, unit="N·m", u_max=1.0)
    lever = (ARM / PADDLE) / (THETA[2] / THETA[3])
    drag = Effect("pendulum_quadratic_drag", {"c": C_AIR * PADDLE**3, "λ": lever})
    return bare, bare.with_effects(drag)


@given(q1=angles, q2=angles, v1=st.floats(-20, 20), v2=st.floats(-20, 20))
def test_torques_are_those_of_a_paddle_in_still_air(q1, q2, v1, v2):
    bare, dragged = with_paddle()
    x = [q1, q2, v1, v2]
    change = np.asarray(derivative(dragged, x, 0.0))[2:4] - np.asarray(derivative(bare, x, 0.0))[2:4]
    s, c = math.sin(q2), math.cos(q2)
    mass_matrix = np.array([[THETA[0] + THETA[1] * s**2, THETA[2] * c], [THETA[2] * c, THETA[3]]])
    wanted = torques(q1, q2, v1, v2)
    np.testing.assert_allclose(mass_matrix @ change, wanted, atol=1e-6 * (1 + np.abs(wanted).max()))


def test_an_arm_that_turns_sweeps_a_hanging_pendulum_through_the_air():
    """The plain law, λ = 0, knows nothing of this: at q̇2 = 0 it takes no torque from either joint."""
    bare, dragged = with_paddle()
    x = [0.0, math.pi, 5.0, 0.0]
    assert abs(derivative(dragged, x, 0.0)[2]) > 0.1
    plain = bare.with_effects(Effect("pendulum_quadratic_drag", {"c": C_AIR * PADDLE**3}))
    assert derivative(plain, x, 0.0)[2] == pytest.approx(derivative(bare, x, 0.0)[2], abs=1e-12)


def test_a_pendulum_on_a_turning_arm_swings_less_with_air():
    bare, dragged = with_paddle()
    period = 2 * math.pi / pendulum_frequency(THETA)
    t = np.arange(0.0, 5 * period, 0.01)
    ends = [run(plant, [0.0, math.pi - 1.0, 1.0, 0.0], t, np.zeros_like(t), 5 * period) for plant in (bare, dragged)]
    fastest = [np.abs(states[-50:, 3]).max() for states in ends]
    assert fastest[1] < 0.9 * fastest[0]
