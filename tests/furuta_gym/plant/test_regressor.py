"""Y θ = (τ, 0), and Ω_a, Ω_b of Eq. (14) with the nine columns that the errata restore."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from furuta_gym.plant.regressor import omega_a, omega_b, regressor
from tests.furuta_gym.plant.strategies import speeds, states, thetas
from tests.oracles import lagrangian
from tests.oracles.reference import rates

accelerations = st.floats(-200.0, 200.0)
ORACLE = lagrangian.numeric()


@given(states, accelerations, accelerations, thetas(), st.floats(1, 1000))
def test_y_theta_is_the_left_side_of_model_5(x, a1, a2, theta, r):
    Y = regressor([x[:2]], [x[2:]], [[a1, a2]], r)
    left = ORACLE["M"](*x, theta) @ [a1, a2] + (ORACLE["h"](*x, theta) + ORACLE["g"](*x, theta)).ravel()
    left += [theta[5] * x[2] + theta[7] * np.tanh(r * x[2]), theta[6] * x[3] + theta[8] * np.tanh(r * x[3])]
    np.testing.assert_allclose(Y[0] @ theta, left, rtol=1e-10, atol=1e-9)


@given(states, thetas(), st.floats(-3, 3), st.floats(1, 1000))
def test_y_theta_gives_back_the_torque_that_moved_the_plant(x, theta, tau, r):
    a = rates(0.0, x, tau, theta, r, {})[2:]
    residual = regressor([x[:2]], [x[2:]], [a], r)[0] @ theta - [tau, 0.0]
    np.testing.assert_allclose(residual, 0.0, atol=1e-9 * (1 + np.abs(a).max()))


@given(states, thetas())
def test_omega_a_theta_is_the_momentum(x, theta):
    np.testing.assert_allclose(
        omega_a([x[:2]], [x[2:]])[0] @ theta, ORACLE["M"](*x, theta) @ x[2:], rtol=1e-10, atol=1e-10
    )


@given(states, speeds, speeds)
def test_y_is_the_rate_of_omega_a_plus_omega_b(x, a1, a2):
    """d/dt Ω_a by a central difference along a smooth path through the state."""
    q, v, a, h = np.array(x[:2]), np.array(x[2:]), np.array([a1, a2]), 1e-5

    def on_path(s):
        return omega_a([q + s * v + 0.5 * s**2 * a], [v + s * a])[0]

    rate = (on_path(h) - on_path(-h)) / (2 * h)
    expected = rate + omega_b([q], [v], 50.0)[0]
    scale = 1 + np.abs(v).max() ** 4 + np.abs(a).max() ** 2
    np.testing.assert_allclose(regressor([q], [v], [a], 50.0)[0], expected, atol=1e-7 * scale)


def test_all_nine_columns_are_there_and_the_batch_is_rows():
    rng = np.random.default_rng(8)
    q, v, a = rng.normal(size=(3, 5, 2))
    for whole, rows in (
        (omega_a(q, v), [omega_a(q[i], v[i])[0] for i in range(5)]),
        (omega_b(q, v, (20.0, 80.0)), [omega_b(q[i], v[i], (20.0, 80.0))[0] for i in range(5)]),
        (regressor(q, v, a, 30.0), [regressor(q[i], v[i], a[i], 30.0)[0] for i in range(5)]),
    ):
        assert whole.shape == (5, 2, 9)
        np.testing.assert_array_equal(whole, rows)
    np.testing.assert_array_equal(omega_a(q, v)[:, :, 4:], 0.0)  # θ5 … θ9 carry no momentum (erratum 2)


def test_each_axis_has_its_own_sharpness():
    omega = omega_b([[0.0, 0.0]], [[0.01, 0.01]], (20.0, 80.0))[0]
    np.testing.assert_allclose([omega[0, 7], omega[1, 8]], np.tanh([0.2, 0.8]))


@pytest.mark.parametrize("q", [np.zeros((4, 3)), np.zeros((3, 2))], ids=["columns", "rows"])
def test_wrong_shapes_are_named(q):
    with pytest.raises(ValueError, match="shape"):
        omega_a(q, np.zeros((4, 2)))


@pytest.mark.parametrize("a", [np.zeros((3, 2)), np.zeros((4, 3)), np.zeros((1, 2))], ids=["rows", "columns", "one"])
def test_wrong_shape_of_the_acceleration_is_named(a):
    with pytest.raises(ValueError, match="shape"):
        regressor(np.zeros((4, 2)), np.zeros((4, 2)), a, 100.0)
