"""M, C, g, friction, q̈ and energy of the compiled model (5) against SymPy's Lagrangian and the plain equations."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from furuta_gym.plant.dynamics import acceleration, bias_torque, energy, friction_torque, mass_matrix
from tests.furuta_gym.plant.strategies import angles, states, thetas
from tests.oracles import lagrangian
from tests.oracles.reference import rates

ORACLE = lagrangian.numeric()
sharpnesses = st.floats(1.0, 1000.0)


@given(states, thetas())
def test_mass_matrix_is_the_lagrangians(x, theta):
    m11, m12, m22 = mass_matrix(x[1], *theta[:4])
    np.testing.assert_allclose([[m11, m12], [m12, m22]], ORACLE["M"](*x, theta), rtol=1e-13, atol=1e-15)


@given(angles, thetas())
def test_mass_matrix_is_positive_definite_where_theta_allows_it(q2, theta):
    m11, m12, m22 = mass_matrix(q2, *theta[:4])
    assert m11 > 0
    assert m11 * m22 - m12**2 > 0


@given(states, thetas())
def test_velocity_and_gravity_torques_are_the_lagrangians(x, theta):
    given_ = bias_torque(x[1], x[2], x[3], theta[1], theta[2], theta[4])
    expected = (ORACLE["h"](*x, theta) + ORACLE["g"](*x, theta)).ravel()
    np.testing.assert_allclose(given_, expected, rtol=1e-11, atol=1e-12 * (1 + x[2] ** 2 + x[3] ** 2))


@given(states, thetas())
def test_energy_is_the_lagrangians(x, theta):
    np.testing.assert_allclose(
        energy(x[1], x[2], x[3], *theta[:5]), ORACLE["energy"](*x, theta), rtol=1e-12, atol=1e-12
    )


@given(states, thetas(), sharpnesses, sharpnesses)
def test_friction_is_viscous_and_coulomb_and_opposes_motion(x, theta, r1, r2):
    v1, v2 = x[2:]
    f1, f2 = friction_torque(v1, v2, *theta[5:], r1, r2)
    np.testing.assert_allclose(
        [f1, f2],
        [theta[5] * v1 + theta[7] * np.tanh(r1 * v1), theta[6] * v2 + theta[8] * np.tanh(r2 * v2)],
        atol=1e-14,
    )
    assert f1 * v1 >= 0
    assert f2 * v2 >= 0


@given(states, thetas(), sharpnesses, st.floats(-5, 5), st.floats(-5, 5))
def test_acceleration_solves_model_5(x, theta, r, tau, w2):
    a = acceleration(x[1], x[2], x[3], tau, w2, *theta, r, r)
    expected = rates(0.0, x, tau, theta, r, {}, (0.0, w2))[2:]
    np.testing.assert_allclose(a, expected, rtol=1e-9, atol=1e-9)


def _work_of_velocity_torques(x, theta, velocity_torques) -> float:
    """½ q̇ᵀ Ṁ q̇ − q̇ᵀ C q̇, the power that the velocity terms would create: zero when Ṁ − 2C is skew."""
    q2, v = x[1], np.array(x[2:])
    step = 1e-5
    ahead, behind = (mass_matrix(q2 + sign * step, *theta[:4]) for sign in (1, -1))
    d11, d12, d22 = ((b - a) / (2 * step) * v[1] for a, b in zip(behind, ahead, strict=True))
    return float(0.5 * v @ np.array([[d11, d12], [d12, d22]]) @ v - v @ velocity_torques)


@given(states, thetas())
def test_velocity_torques_create_no_energy(x, theta):
    torques = np.array(bias_torque(x[1], x[2], x[3], theta[1], theta[2], theta[4])) - [
        0.0,
        -theta[4] * np.sin(x[1]),
    ]
    scale = 1 + np.abs(x[2:]).max() ** 3
    assert abs(_work_of_velocity_torques(x, theta, torques)) < 1e-8 * scale


def test_velocity_torques_as_printed_do_create_energy():
    """Equation (8) as printed (C11 with q̇1) fails the same check; the plant must not agree with it."""
    theta = np.array([0.2, 0.04, 0.02, 0.05, 0.4, 0, 0, 0, 0])
    x = (0.0, 0.8, 2.0, -3.0)
    printed = ORACLE["C_printed"](*x, theta) @ x[2:]
    assert abs(_work_of_velocity_torques(x, theta, printed)) > 0.1


def test_skew_symmetry_row_by_row():
    """Ṁ − 2C is skew for the C that the plant's velocity torques imply (Christoffel form), entry by entry."""
    rng = np.random.default_rng(5)
    theta = np.array([0.2, 0.04, 0.02, 0.05, 0.4, 0, 0, 0, 0])
    for q2, v1, v2 in rng.uniform(-3, 3, (50, 3)):
        C = ORACLE["C"](0.0, q2, v1, v2, theta)
        np.testing.assert_allclose(
            C @ [v1, v2] + [0.0, -theta[4] * np.sin(q2)],
            bias_torque(q2, v1, v2, theta[1], theta[2], theta[4]),
            atol=1e-13,
        )
        rate = np.array([[theta[1] * np.sin(2 * q2), -theta[2] * np.sin(q2)], [-theta[2] * np.sin(q2), 0]]) * v2
        np.testing.assert_allclose((rate - 2 * C) + (rate - 2 * C).T, 0.0, atol=1e-14)
