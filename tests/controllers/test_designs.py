"""Gains and poles against independent computations."""

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm, solve_continuous_are

from controllers import CONTROLLERS, DesignError, make_controller
from controllers.design import Weights, balance_point, design_model
from controllers.linear.lqg import kalman_gain, measurement_noise
from controllers.linear.lqr import dlqr_gain, lqr_gain
from furuta_gym.plant import LARGE_RIG, PLANTS, QUBE, TABLE_3, Effect
from furuta_gym.plant.linearization import discretize, linearize
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import DEFAULT_SAMPLE_TIME, simulate

LINEAR = ("lqr", "dlqr", "lqg", "lqr-friction", "lqg-friction", "lqi")


def test_lqr_gain_solves_the_riccati_equation(plant):
    linear, weights = linearize(plant), Weights.of(plant)
    P = solve_continuous_are(linear.A, linear.B, weights.Q, weights.R)
    expected = np.linalg.solve(weights.R, linear.B.T @ P).ravel()
    assert lqr_gain(plant) == pytest.approx(expected, rel=1e-6)


def test_what_follows_time_does_not_move_the_balance_point(plant):
    """A torque that repeats holds nothing up on the average, whatever its phase at the start."""
    wobbling = plant.with_effects(Effect("periodic_torque", {"A": 0.05 * plant.u_max, "f": 3.3, "φ": 1.57}))
    assert balance_point(wobbling) == balance_point(plant)
    assert make_controller("lqr", wobbling, 0.004)([0.0, 0.0]) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("name", ["lqr", "lqg", "lqi"])
def test_a_supply_counts_as_a_largest_command_does(name):
    """What the motor never gets must not be in an estimator's prediction."""
    y = np.random.default_rng(0).normal(0.0, 0.02, (200, 2)).cumsum(axis=0)
    by_limit = make_controller(name, QUBE.replace(limits={"supply": 4.0}), 0.004)
    by_command = make_controller(name, QUBE.replace(u_max=4.0), 0.004)
    assert [by_limit(row) for row in y] == [by_command(row) for row in y]
    assert by_limit.u_max == 4.0


def test_a_dead_zone_as_wide_as_the_limit_is_refused():
    dead = LARGE_RIG.with_effects(Effect("input_dead_zone", {"w": LARGE_RIG.u_max}))
    with pytest.raises(DesignError, match="dead zone"):
        make_controller("lqr", dead, 0.002)


@pytest.mark.parametrize("T", [0.0005, 0.001, 0.002, 0.01])
@pytest.mark.parametrize("rig", PLANTS)
def test_every_usual_sample_time_has_its_designs(rig: str, T: float):
    """SLICOT's ordering of the eigenvalues fails for some of them."""
    for name in LINEAR:
        controller = make_controller(name, PLANTS[rig], T)
        assert np.isfinite(controller([0.0, 0.01])), name


def test_a_swing_up_is_designed_for_a_rig_of_a_kilohertz():
    assert make_controller("swing-up", QUBE, 0.001)([0.0, np.pi]) != 0.0


def test_dlqr_gain_is_the_limit_of_value_iteration(plant):
    model, weights = design_model(plant, 0.004), Weights.of(plant)
    A, B, Q, R = model.A, model.B, weights.Q, weights.R
    P = Q.copy()
    for _ in range(5000):
        K = np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)
        P = Q + A.T @ P @ (A - B @ K)
    assert dlqr_gain(model, weights) == pytest.approx(K.ravel(), rel=1e-6)


def test_kalman_gain_is_the_limit_of_the_filter(plant):
    model, R = design_model(plant, 0.004), measurement_noise(Sensors(2048, noise_std=1e-3))
    P = np.eye(4)
    for _ in range(5000):
        L = P @ model.C.T @ np.linalg.inv(model.C @ P @ model.C.T + R)
        P = model.A @ (P - L @ model.C @ P) @ model.A.T + model.noise
    assert kalman_gain(model, R) == pytest.approx(L, rel=1e-5, abs=1e-9)


def test_encoder_noise_is_the_variance_of_rounding():
    q = np.random.default_rng(0).uniform(-3, 3, 200_000)
    step = 2 * np.pi / 2048
    assert measurement_noise(Sensors(2048))[0, 0] == pytest.approx(np.var(step * np.round(q / step) - q), rel=0.01)


def test_design_model_without_command_path_is_the_held_plant(plant):
    model = design_model(plant, 0.004)
    A, B = discretize(linearize(plant), 0.004)
    assert pytest.approx(A, abs=1e-9) == model.A
    assert pytest.approx(B, abs=1e-9) == model.B
    assert (model.q2e, model.torque) == (0.0, 0.0)


@pytest.mark.parametrize("delay", [0.0013, 0.004, 0.0101])
def test_design_model_delays_the_command(delay):
    """The model's answer to a pulse against the delayed plant's, put together from matrix exponentials."""
    T, plant = 0.004, QUBE.with_effects(Effect("input_delay", {"d": delay}))
    linear, model = linearize(QUBE), design_model(plant, T)
    x = model.B[:, 0]
    for _ in range(9):
        x = model.A @ x
    # a unit torque from `delay` to `delay + T`, looked at 10 samples after the command
    grid = delay + T * (np.arange(20) + 0.5) / 20
    expected = np.mean([expm(linear.A * (10 * T - s)) @ linear.B[:, 0] for s in grid], axis=0) * T
    assert x[:4] == pytest.approx(expected, rel=1e-3)


def test_design_model_lags_the_command():
    plant = LARGE_RIG.with_effects(Effect("actuator_lag", {"T": 0.02}))
    model, linear = design_model(plant, 0.002), linearize(LARGE_RIG)
    assert model.size == 5
    poles = np.log(np.linalg.eigvals(model.A)) / 0.002
    assert np.sort(poles.real) == pytest.approx(np.sort([*linear.poles.real, -50.0]), abs=1e-3)


def test_torque_noise_covariance_against_a_sum():
    model, linear = design_model(LARGE_RIG, 0.01), linearize(LARGE_RIG)
    from controllers.design import torque_noise_intensity

    th1, _, th3, th4 = LARGE_RIG.theta[:4]
    W = np.vstack([np.zeros((2, 2)), np.linalg.inv([[th1, th3], [th3, th4]])])
    Q = W @ np.diag(torque_noise_intensity(LARGE_RIG)) @ W.T
    steps = (np.arange(40) + 0.5) / 40 * 0.01
    expected = sum(expm(linear.A * s) @ Q @ expm(linear.A * s).T for s in steps) * (0.01 / 40)
    assert model.noise == pytest.approx(expected, rel=2e-3, abs=1e-10)


def test_friction_effects_do_not_enter_the_linear_design(plant):
    """Their tanh has the slope ΔF·r at rest, which belongs to motions below 1/r only."""
    with_friction = plant.with_effects(*(plant.default_effect(n) for n in ("arm_stribeck", "pendulum_stribeck")))
    assert pytest.approx(design_model(plant, 0.002).A) == design_model(with_friction, 0.002).A


@pytest.mark.parametrize("name", ["base_tilt", "arm_spring", "input_offset", "arm_ripple"])
def test_balance_point_rests(plant, name):
    tilted = plant.with_effects(plant.default_effect(name)).replace(theta=[*plant.theta[:7], 0.0, 0.0])
    q2e, torque = balance_point(tilted)
    still = tilted.keeping(lambda effect: effect.type.place != "input").replace(u_max=1e3)
    run = simulate(still, lambda y: torque, 0.1, 0.002, x0=(0.0, q2e, 0.0, 0.0))
    assert run.state[-1, :2] == pytest.approx([0.0, q2e], abs=1e-6)


@pytest.mark.parametrize("name", LINEAR)
def test_closed_loop_poles_against_control(plant, name):
    """The loop of plant and controller, put together by python-control from the two systems."""
    T = 0.004
    controller = make_controller(name, plant, T)
    law = controller.law
    model = design_model(plant, T)
    u = control.ss(
        law.A + np.outer(law.G, law.C), law.B[:, :2] + np.outer(law.G, law.D[:2]), law.C[None], law.D[None, :2], T
    )
    rig = control.ss(model.A, model.B, model.C, np.zeros((2, 1)), T)
    poles = control.feedback(rig, u, sign=1).poles()
    assert np.abs(poles).max() < 1
    key = lambda z: (np.round(z.real, 5), np.round(z.imag, 5))  # noqa: E731
    found = controller.closed_loop_poles()
    assert sorted(found, key=key) == pytest.approx(sorted(poles, key=key), abs=1e-4)


def test_separation_principle(plant):
    """LQG's poles are the regulator's and the filter's."""
    T = 0.004
    controller, model = make_controller("lqg", plant, T), design_model(plant, T)
    K, L = dlqr_gain(model, Weights.of(plant)), kalman_gain(model, measurement_noise(Sensors()))
    regulator = np.linalg.eigvals(model.A - model.B @ K[None])
    kalman = np.linalg.eigvals(model.A - model.A @ L @ model.C)
    expected = np.sort(np.abs([*regulator, *kalman]))
    assert np.sort(np.abs(controller.closed_loop_poles())) == pytest.approx(expected, abs=1e-5)


@settings(max_examples=8)
@given(
    scale=st.floats(1e-3, 1e3),
    theta=st.lists(st.floats(0.5, 2.0), min_size=9, max_size=9),
    base=st.sampled_from(list(PLANTS)),
)
def test_designs_do_not_depend_on_the_torque_unit(scale, theta, base):
    """θ in another unit of torque gives the same loop; this is what makes one set of weights serve every rig."""
    values = PLANTS[base].theta * theta
    if values[0] * values[3] < 1.2 * values[2] ** 2:
        return
    plant = PLANTS[base].replace(theta=values, u_max=50 * values[4])
    other = plant.replace(theta=scale * values, u_max=scale * plant.u_max)
    for name in ("dlqr", "lqg"):
        one, two = (make_controller(name, p, 0.002) for p in (plant, other))
        assert np.abs(one.closed_loop_poles()).max() < 1
        assert two.law.D / scale == pytest.approx(one.law.D, rel=1e-4, abs=1e-6 * np.abs(one.law.D).max())


def test_sample_time_is_the_callers_then_the_plants_then_two_milliseconds():
    assert make_controller("lqr", QUBE, 0.01).sample_time == 0.01
    assert make_controller("lqr", QUBE).sample_time == QUBE.sample_time
    assert make_controller("lqr", TABLE_3).sample_time == DEFAULT_SAMPLE_TIME


class TestBadInput:
    def test_unknown_name_lists_the_names(self):
        with pytest.raises(ValueError, match=r"did you mean lqr-friction\?") as error:
            make_controller("lqr_frictoin", TABLE_3)
        assert all(name in str(error.value) for name in CONTROLLERS)

    @pytest.mark.parametrize("sample_time", [0.0, -0.1, 2.0, float("nan")])
    def test_sample_time(self, sample_time):
        with pytest.raises(ValueError, match=r"sample_time .*: expected seconds"):
            make_controller("lqr", TABLE_3, sample_time)

    def test_arm_that_does_not_move_the_pendulum(self):
        theta = TABLE_3.theta.copy()
        theta[2] = 0.0
        with pytest.raises(DesignError, match="θ3 = 0"):
            make_controller("lqr", TABLE_3.replace(theta=theta))

    def test_motor_too_weak_for_the_spring(self):
        spring = TABLE_3.with_effects(Effect("arm_spring", {"k": 20.0, "q1n": 1.0}))
        with pytest.raises(DesignError, match="more than the motor gives"):
            make_controller("lqr", spring)

    @pytest.mark.parametrize("y", [0.0, [1.0], [1.0, 2.0, 3.0], [[[0.0]], [[0.0]]]])
    def test_shape_of_readings(self, y):
        with pytest.raises(ValueError, match="expected readings"):
            make_controller("lqr", TABLE_3)(y)


def test_weights_of_a_pendulum_without_weight_are_finite() -> None:
    """θ5 = 0 in an edited file: no torque holds what does not fall."""
    weightless = TABLE_3.replace(theta=TABLE_3.theta * [1, 1, 1, 1, 0, 1, 1, 1, 1])
    assert Weights.of(weightless).torque == 0.5 * TABLE_3.supply
    assert np.isfinite(Weights.of(weightless).R).all()
