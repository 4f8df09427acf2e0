"""θ: what is accepted, what is a possible rigid body, and the named sets."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from furuta_gym.plant import (
    LARGE_RIG,
    PLANTS,
    QUBE,
    TABLE_3,
    THETA_MEANING,
    THETA_NAMES,
    RigidBody,
    physical_consistency,
)
from furuta_gym.plant.covariance import Covariance
from furuta_gym.plant.dynamics import mass_matrix
from furuta_gym.plant.parameters import pendulum_frequency, theta_vector
from furuta_gym.plant.rigid_body import nearest_rigid_body
from tests.furuta_gym.plant.strategies import thetas
from tests.oracles.mujoco_model import RigidSet

sizes = st.floats(1e-3, 1.0)
losses = st.floats(0.0, 0.1)
bodies = st.builds(RigidBody, *(sizes,) * 5, *(losses,) * 4, gain=st.floats(0.1, 100.0), gravity=st.just(9.81))


def test_table_3_is_the_papers():
    printed = [0.19717, 0.03909, 0.01746, 0.01187, 0.40808, 0.0108, 0.00267, 0.11456, 0.00732]
    np.testing.assert_array_equal(TABLE_3.theta, printed)
    assert TABLE_3.unit == "V"
    assert TABLE_3.theta[2] / TABLE_3.theta[4] * 9.81 == pytest.approx(0.42, abs=0.005)  # erratum 6: L1


def test_table_3_is_no_rigid_body_and_the_check_says_why():
    """Erratum 5: θ4 < θ2, J2 = −0.0272; M is positive definite all the same."""
    check = physical_consistency(TABLE_3.theta)
    assert not check.consistent
    (failure,) = check.failures
    assert "θ4" in failure
    assert "θ2" in failure
    assert "-0.0272" in failure
    for q2 in np.linspace(0, np.pi, 50):
        m11, m12, m22 = mass_matrix(q2, *TABLE_3.theta[:4])
        assert m11 * m22 > m12**2


@pytest.mark.parametrize("plant", [LARGE_RIG, QUBE], ids=["large", "qube"])
def test_the_other_named_sets_are_rigid_bodies(plant):
    assert physical_consistency(plant.theta).consistent
    rigid = RigidSet.from_theta(plant.theta)
    assert min(rigid.J1, rigid.J2, rigid.m2, rigid.L1, rigid.l2) > 0
    assert rigid.J1 > rigid.J2 / 2  # a body of this θ exists (see the MuJoCo oracle)


def test_qube_set_is_near_what_independent_fits_saw():
    """Published fits of the real device, in volts: bands of the measured data's own notes."""
    th = QUBE.theta
    assert th[0] == pytest.approx(0.058, rel=0.1)
    assert 0.0235 < th[3] < 0.028
    assert 0.024 < th[2] < 0.029
    assert 3.0 <= th[4] <= 3.25
    assert 0.10 <= th[7] <= 0.135
    assert np.sqrt(th[4] / th[3]) / (2 * np.pi) == pytest.approx(1.755, rel=0.05)


@given(bodies)
def test_rigid_body_gives_table_2_and_is_consistent(body):
    expected = RigidSet(
        body.J1, body.m2, body.L1, body.l2, body.J2, body.gravity, (body.Fv1, body.Fv2)
    ).theta + np.array([0, 0, 0, 0, 0, 0, 0, body.Fc1, body.Fc2])
    np.testing.assert_allclose(body.theta(), body.gain * expected, rtol=1e-12)
    assert physical_consistency(body.theta()).consistent


@given(thetas())
def test_consistency_is_what_table_2_demands(theta):
    """The verdict is the sign of J1 and J2 that Table 2 leaves, and each failure has its sentence."""
    J1, J2 = theta[0] - theta[2] ** 2 / theta[1], theta[3] - theta[1]
    check = physical_consistency(theta)
    assert check.consistent == (J1 >= 0 and J2 >= 0)
    assert len(check.failures) == (J1 < 0) + (J2 < 0)


def _with_error(names, matrix):
    return Covariance(tuple(names), np.array(matrix))


@pytest.mark.parametrize(("std", "possible"), [(1e-5, True), (2e-6, False)])
def test_a_thin_rod_is_a_rigid_body_within_its_error_bars(std, possible):
    """θ4 = θ2 for a thin rod, so half of its estimates have θ4 < θ2: here by 5e-6, against 1.96 deviations."""
    theta = LARGE_RIG.theta.copy()
    theta[1] = theta[3] + 5e-6
    assert not physical_consistency(theta).consistent
    errors = _with_error(["theta2", "theta4"], [[std**2, 0.0], [0.0, 0.0]])
    assert physical_consistency(theta, errors).consistent == possible
    together = _with_error(["theta2", "theta4"], np.full((2, 2), std**2))  # their difference is known exactly
    assert not physical_consistency(theta, together).consistent


@pytest.mark.parametrize("share", [0.9, 1.1])
def test_the_arms_inertia_is_judged_by_its_error_bar_too(share):
    """θ1 θ2 < θ3² by `share` times its error bar, which θ1, θ2 and θ3 make together: drawn, not derived."""
    theta = LARGE_RIG.theta.copy()
    theta[0] = theta[2] ** 2 / theta[1]
    matrix = np.diag(np.square(0.001 * theta[:3]))
    rng = np.random.default_rng(0)
    th1, th2, th3 = rng.multivariate_normal(theta[:3], matrix, 100_000).T
    theta[0] -= share * 1.96 * np.std(th1 * th2 - th3**2) / theta[1]
    assert physical_consistency(theta, _with_error(THETA_NAMES[:3], matrix)).consistent == (share < 1.0)


@pytest.mark.parametrize(("deviations", "possible"), [(1.5, True), (4.0, False), (9.0, False)])
def test_a_theta2_far_below_its_limit_is_no_rigid_body(deviations, possible):
    """However large J1 = θ1 − θ3²/θ2 and its error bar become there."""
    theta = LARGE_RIG.theta.copy()
    limit = theta[2] ** 2 / theta[0]
    std = 0.9 * limit / 9.0
    theta[1] = limit - deviations * std
    assert physical_consistency(theta, _with_error(["theta2"], [[std**2]])).consistent == possible


@given(data=st.data())
def test_the_nearest_rigid_body_is_one_and_the_likeliest(data):
    """Against other points on the limits, by their distance in error bars."""
    rng = np.random.default_rng(data.draw(st.integers(0, 10**6)))
    theta = LARGE_RIG.theta.copy()
    theta[1] = theta[3]  # a thin rod
    root = rng.normal(size=(5, 5)) * 0.01 * theta[:5, None]
    covariance = _with_error(THETA_NAMES[:5], root @ root.T)
    estimate = theta.copy()
    estimate[:5] += root @ rng.normal(size=5)
    near = nearest_rigid_body(estimate, covariance)
    np.testing.assert_array_equal(near[5:], estimate[5:])
    if estimate[3] >= estimate[1]:
        np.testing.assert_array_equal(near, estimate)
        return
    assert near[3] == pytest.approx(near[1], rel=1e-6)
    far = np.linalg.solve(root, near[:5] - estimate[:5])
    for other in (0.1 * root @ rng.normal(size=(5, 20))).T:
        there = near[:5] + other - (other[3] - other[1]) * np.array([0, 0, 0, 1, 0])
        assert np.linalg.norm(np.linalg.solve(root, there - estimate[:5])) >= np.linalg.norm(far) * (1 - 1e-6)


@pytest.mark.parametrize("index", range(5, 9))
def test_negative_friction_is_named(index):
    theta = LARGE_RIG.theta.copy()
    theta[index] = -0.01
    (failure,) = physical_consistency(theta).failures
    assert f"θ{index + 1}" in failure


@given(thetas())
def test_theta_survives_both_forms_and_cannot_be_written(theta):
    values = theta_vector(dict(zip(THETA_NAMES, theta, strict=True)))
    np.testing.assert_array_equal(values, theta_vector(theta))
    with pytest.raises(ValueError, match="read-only"):
        values[0] = 1.0


def test_theta_does_not_share_memory_with_its_source():
    source = LARGE_RIG.theta.copy()
    values = theta_vector(source)
    source[0] = 99.0
    assert values[0] == LARGE_RIG.theta[0]


BAD = {
    "eight numbers": np.ones(8),
    "a matrix": np.eye(3),
    "NaN": [0.2, 0.04, 0.02, 0.05, float("nan"), 0, 0, 0, 0],
    "infinity": [float("inf"), 0.04, 0.02, 0.05, 0.4, 0, 0, 0, 0],
    "text": ["a"] * 9,
    "no inertia": [0.0, 0.04, 0.02, 0.05, 0.4, 0, 0, 0, 0],
    "M indefinite upright": [0.01, 0.04, 0.05, 0.02, 0.4, 0, 0, 0, 0],
    "M indefinite level": [0.01, -0.02, 0.001, 0.02, 0.4, 0, 0, 0, 0],
    "missing name": {"theta1": 1.0},
    "unknown name": dict.fromkeys(THETA_NAMES, 1.0) | {"theta10": 1.0},
}


@pytest.mark.parametrize("theta", BAD.values(), ids=BAD)
def test_bad_theta_is_an_error_that_names_theta(theta):
    with pytest.raises(ValueError, match=r"theta|θ"):
        theta_vector(theta)


def test_every_parameter_has_a_meaning_and_a_unit():
    assert tuple(THETA_MEANING) == THETA_NAMES
    assert all(meaning and "{u}" in unit for meaning, unit in THETA_MEANING.values())
    assert set(PLANTS) >= {"table3", "qube"}


@given(bodies)
def test_the_pendulums_frequency_is_that_of_its_small_swings(body):
    """Of a rod about its joint: √(m g l / J), whatever the unit of the command."""
    inertia = body.J2 + body.m2 * body.l2**2
    assert pendulum_frequency(body.theta()) == pytest.approx(np.sqrt(body.m2 * body.gravity * body.l2 / inertia))
