"""The linearized plant against finite differences of the oracle, and the errata's signs and poles."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from furuta_gym.plant import LARGE_RIG, PAPER_GAIN, PLANTS, TABLE_3, Effect
from furuta_gym.plant.linearization import discretize, linearize
from tests.furuta_gym.plant.helpers import oracle
from tests.oracles.reference import rates

PAPER_ORDER = [0, 2, 1, 3]  # the paper's x = [q1, q̇1, q2, q̇2] out of ours [q1, q2, q̇1, q̇2]


def by_differences(plant, x, tau, coulomb):
    """A, B from the plain equations; without Coulomb friction unless asked for."""
    reference = oracle(plant)
    theta = reference.theta if coulomb else (*reference.theta[:7], 0.0, 0.0)

    def f(x, tau):
        return np.array(rates(0.0, x, tau, theta, reference.r, reference.effects))

    A = np.empty((4, 4))
    h = 1e-5
    for i in range(4):
        step = h * np.eye(4)[i]
        A[:, i] = (f(x + step, tau) - f(x - step, tau)) / (2 * h)
    return A, (f(x, tau + 0.5) - f(x, tau - 0.5))[:, None]


@pytest.mark.parametrize("coulomb", [False, True], ids=["viscous", "coulomb"])
@pytest.mark.parametrize("q2", [0.0, np.pi], ids=["upright", "hanging"])
@pytest.mark.parametrize("plant", PLANTS.values(), ids=PLANTS)
def test_matrices_are_the_derivatives_of_the_oracle(plant, q2, coulomb):
    linear = linearize(plant, q2, coulomb=coulomb)
    A, B = by_differences(plant, np.array([0.0, q2, 0.0, 0.0]), 0.0, coulomb)
    np.testing.assert_allclose(linear.A, A, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(linear.B, B, rtol=1e-8, atol=1e-8)
    assert linear.tau == pytest.approx(0.0, abs=1e-12)


EFFECTS_ON_THE_ROWS = {
    "spring": Effect("arm_spring", {"k": 0.3, "q1n": -0.5}),
    "ripple": Effect("arm_ripple", {"A": 0.05, "n": 7, "φ": 0.4}),
    "payload from the start": Effect("payload_step", {"m": 0.3, "t0": 0.0}),
}


@pytest.mark.parametrize("effect", EFFECTS_ON_THE_ROWS.values(), ids=EFFECTS_ON_THE_ROWS)
@pytest.mark.parametrize("q2", [0.0, np.pi], ids=["upright", "hanging"])
def test_effects_on_the_rows_enter(effect, q2):
    plant, q1 = LARGE_RIG.with_effects(effect), 0.2
    linear = linearize(plant, q2, q1)
    x = np.array([q1, q2, 0.0, 0.0])
    A, B = by_differences(plant, x, linear.tau, coulomb=False)
    np.testing.assert_allclose(linear.A, A, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(linear.B, B, rtol=1e-8, atol=1e-8)
    reference = oracle(plant)
    at_rest = rates(0.0, x, linear.tau, reference.theta, reference.r, reference.effects)
    np.testing.assert_allclose(at_rest, 0.0, atol=1e-9)  # linear.tau holds the arm there


@pytest.mark.parametrize("names", [("input_delay", "actuator_lag"), ("arm_backlash",), ("arm_presliding",)])
def test_memory_and_command_effects_leave_the_matrices_alone(names):
    plant = LARGE_RIG.with_effects(*(LARGE_RIG.default_effect(name) for name in names))
    np.testing.assert_array_equal(linearize(plant).A, linearize(LARGE_RIG).A)


@pytest.mark.parametrize("q2", [0.0, np.pi], ids=["upright", "hanging"])
def test_friction_of_effects_enters_where_coulomb_friction_does(q2):
    names = ("arm_stribeck", "arm_position_friction", "pendulum_stribeck", "pendulum_coulomb_asymmetry")
    for name in names:
        plant = LARGE_RIG.with_effects(LARGE_RIG.default_effect(name))
        np.testing.assert_array_equal(linearize(plant, q2).A, linearize(LARGE_RIG, q2).A)
        slope = linearize(plant, q2, coulomb=True).A - linearize(LARGE_RIG, q2, coulomb=True).A
        assert (np.abs(slope).max() > 0.1) == ("asymmetry" not in name)  # whose slope differs by direction


def closed_loop_poles(sign: float) -> np.ndarray:
    linear = linearize(TABLE_3)
    A, B = linear.A[np.ix_(PAPER_ORDER, PAPER_ORDER)], linear.B[PAPER_ORDER]
    return np.linalg.eigvals(A + sign * B @ np.atleast_2d(PAPER_GAIN))


def test_paper_gain_is_the_printed_one():
    np.testing.assert_allclose(PAPER_GAIN, 0.8 * np.array([-9.1265, -5.2953, -41.5431, -5.6176]))


def test_paper_gain_as_minus_k_x_is_stable_with_the_errata_s_poles():
    expected = [-4.42 - 10.97j, -4.42 + 10.97j, -2.66 - 1.84j, -2.66 + 1.84j]
    poles = closed_loop_poles(-1.0)
    np.testing.assert_allclose(sorted(poles, key=lambda s: (s.real, s.imag)), expected, atol=0.006)


def test_paper_gain_as_printed_is_unstable():
    poles = closed_loop_poles(+1.0)
    assert poles.real.max() == pytest.approx(25.7, abs=0.06)


@pytest.mark.parametrize("plant", PLANTS.values(), ids=PLANTS)
def test_upright_has_one_unstable_pole_and_hanging_none(plant):
    assert np.sum(linearize(plant, 0.0).poles.real > 1e-6) == 1
    assert np.sum(linearize(plant, np.pi).poles.real > 1e-6) == 0


@given(st.floats(1e-4, 0.1), st.sampled_from([0.0, np.pi]))
def test_discretization_is_the_held_commands_matrix_exponential(sample_time, q2):
    linear = linearize(LARGE_RIG, q2)
    block = np.zeros((5, 5))
    block[:4, :4], block[:4, 4:] = linear.A, linear.B
    whole = expm(block * sample_time)
    A, B = discretize(linear, sample_time)
    np.testing.assert_allclose(A, whole[:4, :4], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(B, whole[:4, 4:], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("q2", [0.3, np.pi / 2, 1e-3, np.nan])
def test_no_equilibrium_is_an_error(q2):
    with pytest.raises(ValueError, match="equilibrium"):
        linearize(LARGE_RIG, q2)


@pytest.mark.parametrize("sample_time", [0.0, -0.01, np.nan])
def test_impossible_sample_time_is_an_error(sample_time):
    with pytest.raises(ValueError, match="sample_time"):
        discretize(linearize(LARGE_RIG), sample_time)
