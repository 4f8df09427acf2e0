"""The compiled Runge–Kutta steps: order, references, energy, and independence of how time is cut."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from furuta_gym.plant import EFFECTS, LARGE_RIG, PLANTS, QUBE, TABLE_3, Effect
from furuta_gym.plant.advance import acting_row, advance, until_next
from furuta_gym.plant.integration import plain_steps, shared_steps
from tests.furuta_gym.plant.helpers import mechanical_energy, reference_run, run, square_waves
from tests.oracles import lagrangian
from tests.oracles.mujoco_model import RigidSet

LOSSLESS = LARGE_RIG.replace(theta=[*LARGE_RIG.theta[:5], 0, 0, 0, 0])
COUNT = 2 * np.pi / 4096
NO_EFFECTS = np.empty((0, 3), dtype=np.int64)


def test_observed_order_is_four_on_the_smooth_model():
    """The error's slope over step size, with friction smooth enough (r = 3) for the order to show."""
    plant = TABLE_3.replace(friction_sharpness=3.0)
    t_u = np.arange(10) * 0.1
    u, x0 = square_waves(t_u), [0.1, 2.5, 0.5, -1.0]
    exact = reference_run(plant, x0, t_u, u, 1.0, rtol=1e-13, atol=1e-14)[-1, :4]
    steps = np.array([0.02, 0.01, 0.005, 0.0025])
    errors = [np.abs(run(plant, x0, t_u, u, 1.0, h)[-1] - exact).max() for h in steps]
    orders = np.diff(np.log(errors)) / np.diff(np.log(steps))
    assert orders.min() > 3.9, f"orders {orders}, errors {errors}"


@pytest.mark.parametrize("plant", PLANTS.values(), ids=PLANTS)
@pytest.mark.parametrize("start", [0.05, 2.9], ids=["upright", "hanging"])
def test_motion_is_the_dop853_reference(plant, start):
    t_u = np.arange(100) * 0.005
    u, x0 = 0.5 * square_waves(t_u), [0.2, start, 0.1, -0.2]
    ours = run(plant, x0, t_u, u, 0.5, h_max=1e-4)
    np.testing.assert_allclose(ours[:, :4], reference_run(plant, x0, t_u, u, 0.5), atol=2e-8)


def test_disturbance_torques_act_on_their_rows():
    t_u, w = np.arange(20) * 0.01, (0.3, -0.05)
    u, x0 = square_waves(t_u), [0.2, 2.9, 0.1, -0.2]
    ours = run(LARGE_RIG, x0, t_u, u, 0.2, h_max=1e-4, w=w)
    np.testing.assert_allclose(ours, reference_run(LARGE_RIG, x0, t_u, u, 0.2, w=w), atol=1e-8)
    assert np.abs(ours - run(LARGE_RIG, x0, t_u, u, 0.2, h_max=1e-4)).max() > 0.01


def test_energy_is_kept_for_seconds_without_friction_and_input():
    states = run(LOSSLESS, [0.3, 0.4, 2.0, -1.0], np.arange(500) * 0.01, np.zeros(500), 5.0)
    levels = np.array([mechanical_energy(LOSSLESS, x) for x in states])
    assert np.ptp(states[:, 1]) > 3.0  # it does swing through
    np.testing.assert_allclose(levels, levels[0], atol=1e-8)


def test_energy_is_not_kept_with_the_printed_c11():
    """Erratum 1: the same motion under equation (8) as printed gains or loses a large part of its energy."""
    numeric, theta = lagrangian.numeric(), LOSSLESS.theta

    def rates(_, x):
        torque = numeric["C_printed"](*x, theta) @ x[2:] + numeric["g"](*x, theta).ravel()
        return [*x[2:], *np.linalg.solve(numeric["M"](*x, theta), -torque)]

    path = solve_ivp(rates, (0, 5), [0.3, 0.4, 2.0, -1.0], "DOP853", np.arange(0, 5, 0.01), rtol=1e-9).y.T
    levels = np.array([mechanical_energy(LOSSLESS, x) for x in path])
    assert np.ptp(levels) > 0.1 * np.ptp([LOSSLESS.theta[4], -LOSSLESS.theta[4]])


@pytest.mark.parametrize("damped", [False, True], ids=["free", "damped"])
@pytest.mark.parametrize("plant", [LARGE_RIG, QUBE], ids=["large", "qube"])
def test_free_motion_agrees_with_mujoco(plant, damped):
    """Seconds of swinging over the top, against bodies and joints that know no equation of ours."""
    pytest.importorskip("mujoco")
    losses = plant.theta[5:7] if damped else [0, 0]
    plant = plant.replace(theta=[*plant.theta[:5], *losses, 0, 0])
    times = np.arange(201) * 0.02
    x0 = [0.3, 0.5, 3.0, -2.0]
    ours = run(plant, x0, times[:-1], np.zeros(200), 4.0, h_max=2e-4)
    theirs = RigidSet.from_theta(plant.theta).run(x0, times)
    assert np.ptp(theirs[:, 1]) > 2.0
    np.testing.assert_allclose(ours[:, :2], theirs[:, :2], atol=1e-6)


def _lane(plant):
    p, codes, rows = plant.packed()
    return p[:, None], codes, rows


def test_cutting_an_interval_in_two_changes_nothing():
    """advance(a, c) = advance(a, b), advance(b, c): a command may be looked at between its samples."""
    plant = TABLE_3.with_effects(Effect("input_delay", {"d": 0.0033}), Effect("actuator_lag", {"T": 0.004}))
    P, codes, rows = _lane(plant)
    t_u, U, W = np.arange(6) * 0.002, square_waves(np.arange(6) * 0.06)[:, None], np.zeros((2, 1))
    whole, parts = np.zeros((rows, 1)), np.zeros((rows, 1))
    for j in range(6):
        a, c = t_u[j], t_u[j] + 0.002
        advance(whole, a, c, t_u, U, j, W, P, codes, 1e-4)
        for left, right in ((a, a + 0.0004), (a + 0.0004, a + 0.0013), (a + 0.0013, c)):
            advance(parts, left, right, t_u, U, j, W, P, codes, 1e-4)
    assert np.abs(whole[2]) > 0.01
    np.testing.assert_allclose(parts, whole, atol=1e-10)


def test_lanes_side_by_side_are_the_plants_alone_bit_for_bit():
    effects = (Effect("arm_spring", {"k": 0.3, "q1n": -0.5}), Effect("arm_presliding", {"σ0": 5.0}))
    plants = [plant.with_effects(*effects) for plant in (TABLE_3, LARGE_RIG, QUBE)]
    P = np.column_stack([plant.packed().p for plant in plants])
    codes, rows = plants[0].packed().codes, plants[0].packed().rows
    X = np.zeros((rows, 3))
    X[1] = 0.1 * np.arange(1, 4)
    t_u = np.arange(50) * 0.004
    U = np.column_stack([scale * square_waves(t_u) for scale in (1.0, 0.4, 1.5)])
    for j, (a, b) in enumerate(zip(t_u, [*t_u[1:], 0.2], strict=True)):
        advance(X, a, b, t_u, U, j, np.zeros((2, 3)), P, codes, 1e-3)
    for lane, plant in enumerate(plants):
        alone = run(plant, [0, 0.1 * (lane + 1), 0, 0], t_u, U[:, lane], 0.2)
        np.testing.assert_array_equal(X[:, lane], alone[-1])


def test_lanes_with_different_delays_keep_their_own_command():
    """Each lane's delay picks its own sample; steps differ from the plant alone, results to their error only."""
    delays, t_u = [0.0, 0.0013, 0.004, 0.0101], np.arange(60) * 0.002
    plants = [TABLE_3.with_effects(Effect("input_delay", {"d": d})) for d in delays]
    P, codes = np.column_stack([plant.packed().p for plant in plants]), plants[0].packed().codes
    X, U = np.zeros((4, 4)), square_waves(t_u)[:, None]
    X[1] = 0.05
    for j in range(60):
        advance(X, t_u[j], t_u[j] + 0.002, t_u, U, j, np.zeros((2, 4)), P, codes, 1e-4)
    for lane, plant in enumerate(plants):
        expected = reference_run(plant, [0, 0.05, 0, 0], t_u, U[:, 0], 0.12)[-1]
        np.testing.assert_allclose(X[:, lane], expected, atol=1e-8)


def test_a_common_command_serves_all_lanes():
    P = np.column_stack([TABLE_3.packed().p] * 3)
    X, t_u, U = np.zeros((4, 3)), np.array([0.0]), np.array([[1.0]])
    advance(X, 0.0, 0.05, t_u, U, 0, np.zeros((2, 3)), P, NO_EFFECTS, 1e-3)
    assert X[0, 0] != 0
    np.testing.assert_array_equal(X, X[:, :1] * np.ones(3))


@pytest.mark.parametrize("lanes", [1, 7, 16])
@pytest.mark.parametrize("plant", PLANTS.values(), ids=PLANTS)
def test_plain_steps_are_the_stages_that_effects_take(plant, lanes):
    """Bit for bit against a plant with a spring of no stiffness, under a command, a step and torques of each lane; with
    shared ones, summed otherwise, to rounding."""
    n, h, u = 4, 5e-4, 0.07 * plant.u_max
    rng = np.random.default_rng(0)
    start, W = rng.normal(size=(4, lanes)), rng.normal(size=(2, lanes)) * 0.01 * plant.u_max
    staged, plain, shared = start.copy(), start.copy(), start.copy()
    idle = plant.with_effects(Effect("arm_spring", {"k": 0.0})).packed()
    P = np.repeat(idle.p[:, None], lanes, axis=1)
    advance(staged, 0.0, n * h, np.zeros(1), np.full((1, 1), u), 0, W, P, idle.codes, h)
    plain_steps(plain, np.full(lanes, n * h / n), n, np.full(lanes, u), W, P)
    np.testing.assert_array_equal(plain, staged)
    assert np.abs(staged - start).max() > 1e-3
    plain, without = start.copy(), np.zeros((2, lanes))
    plain_steps(plain, np.full(lanes, n * h / n), n, np.full(lanes, u), without, P)
    shared_steps(shared, u, n * h / n, n, P)
    np.testing.assert_allclose(shared, plain, rtol=0, atol=1e-12)


_COMMANDS_AND_READINGS = [n for n, e in EFFECTS.items() if not {*e.kernels} - {"delay", "command", "sensor"}]


@pytest.mark.parametrize("name", _COMMANDS_AND_READINGS)
def test_effects_on_command_and_readings_leave_the_motion_plain(name):
    """The same motion, bit for bit, whether or not an effect that acts within it and adds nothing is beside them."""
    effect, idle = TABLE_3.default_effect(name), Effect("arm_spring", {"k": 0.0})
    found = []
    for effects in ((effect,), (effect, idle)):
        packed = TABLE_3.with_effects(*effects).packed()
        X = np.array([[0.1], [0.2], [-0.3], [0.4]])
        t_u, U = np.array([0.0, 0.004, 0.008]), 0.8 * TABLE_3.u_max * np.array([[1.0], [-0.5], [0.7]])
        for j in range(3):
            t = 0.004 * j
            advance(X, t, t + 0.004, t_u, U, j, np.zeros((2, 1)), packed.p[:, None].copy(), packed.codes, 1e-3)
        found.append(X)
    np.testing.assert_array_equal(*found)


@given(st.lists(st.floats(0, 1), min_size=1, max_size=8), st.floats(0, 1), st.floats(0, 1))
def test_the_command_that_acts_is_the_newest_that_has_come(times, delay, t):
    """Against a search over all rows, for times in rising and in falling order."""
    given_ = np.sort(times)
    come = [i for i, x in enumerate(given_) if x + delay <= t]
    expected, last = max(come, default=0), len(times) - 1
    assert acting_row(given_, last, 0, delay, t) == expected
    assert acting_row(given_[::-1].copy(), 0, last, delay, t) == last - expected


@given(st.floats(-1, 2), st.floats(0, 1), st.floats(0, 1), st.floats(0, 1))
def test_a_command_acts_until_the_next_has_come_and_within_the_interval(given_, delay, a, b):
    start, end = sorted((a, b))
    assert until_next(given_, delay, start, end) == np.clip(given_ + delay, start, end)
