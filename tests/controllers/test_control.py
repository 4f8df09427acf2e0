"""Controllers at work: they balance every rig from encoders, follow references, and undo what they know."""

import numpy as np
import pytest

from controllers import make_controller
from controllers.comparison.trials import Starts, balance_starts, run_trials, swing_up_starts
from controllers.design import Weights, choose_sensors
from controllers.known_effects import KnownEffects
from controllers.linear.lqr import design_dlqr
from controllers.swing_up.energy import design_swing_up
from controllers.swing_up.predictor import Predictor
from controllers.swing_up.region import region_of_attraction
from furuta_gym.plant import LARGE_RIG, PLANTS, QUBE, TABLE_3, Effect
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import Policy, simulate

BALANCERS = ("lqr", "dlqr", "lqg", "lqr-friction", "lqg-friction", "lqi", "swing-up")


def steady(run, quantity):
    return np.sqrt(np.mean(quantity[len(run) // 2 :] ** 2))


@pytest.mark.parametrize("name", BALANCERS)
def test_balances_from_encoders(plant, name):
    T = 0.004
    controller = make_controller(name, plant, T)
    outcome = run_trials(plant, controller, balance_starts(plant, 25, 6.0, np.random.default_rng(7)), 6.0, T)
    assert outcome.success.all()
    assert np.median(outcome.rms_q2) < 0.06
    assert outcome.largest_q1.max() < 2.0


@pytest.mark.parametrize("name", BALANCERS)
def test_one_rig_and_many_side_by_side_are_the_same(name):
    controller = make_controller(name, QUBE)
    y = np.random.default_rng(0).normal(0, 0.05, (50, 2, 3)).cumsum(axis=0)
    assert isinstance(controller, Policy)
    controller.reset()
    together = np.array([controller(step) for step in y])
    for lane in range(3):
        controller.reset()
        alone = [controller(step[:, lane]) for step in y]
        assert all(isinstance(u, float) for u in alone)
        assert alone == pytest.approx(together[:, lane], abs=1e-9)
    assert np.abs(together).max() <= QUBE.u_max


@pytest.mark.parametrize("name", ["dlqr", "lqg", "lqi", "swing-up"])
def test_arm_follows_its_reference(name):
    frictionless = LARGE_RIG.replace(theta=[*LARGE_RIG.theta[:7], 0.0, 0.0])
    controller = make_controller(name, frictionless, 0.004, reference=lambda t: 0.0 if t < 2.0 else 0.5)
    run = simulate(frictionless, controller, 14.0, 0.004)
    assert np.abs(run.state[:400, 0]).max() < 0.02
    assert run.state[-500:, 0] == pytest.approx(0.5, abs=0.03)


def test_integral_action_removes_the_error_of_an_unknown_offset():
    pushed = QUBE.with_effects(Effect("input_offset", {"b": 0.5})).replace(theta=[*QUBE.theta[:7], 0.0, 0.0])
    error = {}
    for name in ("dlqr", "lqi"):
        run = simulate(pushed, make_controller(name, QUBE), 20.0)
        error[name] = abs(run.state[-1000:, 0].mean())
    assert error["dlqr"] > 0.1
    assert error["lqi"] < 0.02


def test_integral_does_not_wind_up():
    """Held for long against its limit the arm comes back without a swing to the other side."""
    weak = QUBE.replace(u_max=1.0, theta=[*QUBE.theta[:7], 0.0, 0.0])
    controller = make_controller("lqi", weak, 0.004)
    for _ in range(2500):
        controller(np.array([1.5, 0.0]))
    stuck = controller._z[-1]
    assert abs(stuck * controller.law.C[-1]) < weak.u_max


def test_friction_compensation_calms_the_arm(plant):
    T = plant.sample_time or 0.002
    rms = {}
    for name in ("dlqr", "lqr-friction", "lqg", "lqg-friction"):
        run = simulate(plant, make_controller(name, plant, T), 12.0, T, x0=(0.1, 0.05, 0.0, 0.0))
        rms[name] = steady(run, run.state[:, 0])
    assert rms["lqr-friction"] < 0.9 * rms["dlqr"]
    assert rms["lqg-friction"] < 0.9 * rms["lqg"]


def test_kalman_filter_sends_a_calmer_command(plant):
    T = plant.sample_time or 0.002
    roughness = {}
    for name in ("dlqr", "lqg"):
        run = simulate(plant, make_controller(name, plant, T), 5.0, T, x0=(0.1, 0.05, 0.0, 0.0))
        roughness[name] = np.abs(np.diff(run.command)).mean()
    assert roughness["lqg"] < roughness["dlqr"]


class TestKnownEffects:
    @pytest.mark.parametrize(
        ("name", "parameters", "rig"),
        [
            ("input_delay", {"d": 0.03}, "qube"),
            ("actuator_lag", {"T": 0.03}, "qube"),
            ("arm_spring", {"k": 3.0, "q1n": 0.3}, "qube"),
        ],
    )
    @pytest.mark.parametrize("design", ["dlqr", "lqg", "lqg-friction"])
    def test_a_controller_that_knows_the_effect_balances_where_another_falls(self, name, parameters, rig, design):
        nominal = PLANTS[rig]
        real = nominal.with_effects(Effect(name, parameters))
        starts = balance_starts(real, 10, 5.0, np.random.default_rng(0))
        knowing, ignorant = (
            run_trials(real, make_controller(design, p, 0.004), starts, 5.0, 0.004).success.mean()
            for p in (real, nominal)
        )
        assert knowing == 1.0
        assert ignorant <= 0.5 or (design.startswith("lqg") and name == "actuator_lag")

    @pytest.mark.parametrize("name", ["pendulum_encoder_offset", "base_tilt"])
    @pytest.mark.parametrize("design", ["dlqr", "lqg"])
    def test_knowing_it_brings_the_arm_back_to_zero(self, name, design):
        nominal = QUBE.replace(theta=[*QUBE.theta[:7], 0.0, 0.0])
        real = nominal.with_effects(QUBE.default_effect(name))
        off = {}
        for plant in (nominal, real):
            run = simulate(real, make_controller(design, plant), 8.0)
            off[plant is real] = abs(run.state[-500:, 0].mean())
        assert off[True] < 0.03
        assert off[False] > 2 * off[True]

    @pytest.mark.parametrize(
        "effects",
        [
            [Effect("input_dead_zone", {"w": 0.3})],
            [Effect("input_offset", {"b": 0.4}), Effect("input_gain_asymmetry", {"a": 0.2})],
            [Effect("input_cubic_gain", {"a": 0.01}), Effect("input_dead_zone", {"w": 0.1})],
            [Effect("input_cubic_gain", {"a": -0.004})],
            [Effect("input_saturation", {"m": 2.0})],
        ],
    )
    def test_command_map_is_inverted(self, effects):
        known = KnownEffects(QUBE.with_effects(*effects))
        low, high = known.torque_limits
        wanted = np.linspace(0.98 * low, 0.98 * high, 101)
        command = known.command(wanted)
        assert known._torques(command) == pytest.approx(wanted, abs=2e-3 * QUBE.u_max)
        assert np.abs(command).max() <= QUBE.u_max

    def test_saturation_asks_for_no_more_than_it_gets(self):
        known = KnownEffects(QUBE.with_effects(Effect("input_saturation", {"m": 2.0})))
        assert known.command(np.array([-50.0, 50.0])) == pytest.approx([-2.0, 2.0], abs=0.05)

    def test_reading_errors_are_undone(self):
        real = QUBE.with_effects(*(QUBE.default_effect(f"{a}_encoder_eccentricity") for a in ("arm", "pendulum")))
        p, codes, _ = real.packed()
        X = np.random.default_rng(0).uniform(-3, 3, (4, 20))
        Y = Sensors(None).read(X, np.repeat(p[:, None], 20, axis=1), codes, np.random.default_rng(0))
        assert np.abs(Y - X[:2]).max() > 0.03
        assert KnownEffects(real).angles(Y) == pytest.approx(X[:2], abs=1e-5)

    @pytest.mark.parametrize("name", ["lqr", "lqg", "lqi", "lqg-friction", "swing-up"])
    def test_the_encoders_zeros_of_the_plant_file_are_undone(self, name):
        """Readings that are off by a known offset give the true arm at zero; without it the arm stays away."""
        rig = QUBE.replace(sensors={"offset": [0.3, 0.02]})
        controller = make_controller(name, rig)
        assert controller.feedback_gain is None
        run = simulate(rig, controller, 8.0, x0=(0.1, 0.02, 0.0, 0.0))
        assert np.abs(run.measured[0] - run.state[0, :2]).max() > 0.25
        assert np.abs(run.state[-500:, 0].mean()) < 0.06
        assert np.abs(run.state[-500:, 1].mean()) < 0.003

    @pytest.mark.parametrize("name", ["lqr", "lqg", "lqi", "lqg-friction", "swing-up"])
    def test_the_encoders_zeros_that_are_given_win(self, name):
        rig = QUBE.replace(sensors={"offset": [0.3, 0.02]})
        controller = make_controller(name, rig, sensors=Sensors())
        run = simulate(rig, controller, 8.0, sensors=Sensors(), x0=(0.1, 0.02, 0.0, 0.0))
        assert np.abs(run.state[-500:, 0].mean()) < 0.06

    @pytest.mark.parametrize(
        ("effects", "most"),
        [
            ([Effect("input_dead_zone", {"w": 0.3})], 8),
            ([Effect("input_saturation", {"m": 2.0})], 6),
            ([Effect("input_saturation", {"m": 6.0, "knee": 0.3}), Effect("input_cubic_gain", {"a": 0.002})], 60),
        ],
    )
    def test_the_command_map_is_short(self, effects, most):
        """A microcontroller keeps it in its memory."""
        torques, commands = KnownEffects(QUBE.with_effects(*effects)).command_map
        assert torques.size == commands.size <= most

    def test_friction_stays_smooth_where_an_effect_sharpens_it(self):
        """Estimated speeds are noisy, so a controller's friction turns over at its own speed, not at the rig's."""
        sharp = QUBE.with_effects(Effect("friction_sharpness", {"r1": 1000.0, "r2": 1000.0}))
        x = np.array([0.0, 0.5, 0.01, 0.0])
        assert KnownEffects(sharp).torque_for(3.0, x) == pytest.approx(KnownEffects(QUBE).torque_for(3.0, x))
        assert max(Predictor(sharp, 0.004, Sensors()).plant.sharpest) <= 30.0
        soft = QUBE.with_effects(Effect("friction_sharpness", {"r1": 8.0, "r2": 0.0}))
        assert Predictor(soft, 0.004, Sensors()).plant.sharpest == (8.0, 30.0)


class TestSwingUp:
    @pytest.mark.parametrize("name", ["qube", "large"])
    def test_swings_up_and_holds(self, name):
        rig = PLANTS[name]
        T = rig.sample_time or 0.004
        outcome = run_trials(
            rig, design_swing_up(rig, T), swing_up_starts(20, np.random.default_rng(3)), 15.0, T, swing_up=True
        )
        assert outcome.success.mean() >= 0.95
        assert np.median(outcome.settling) < 8.0
        assert outcome.largest_q1.max() < np.pi

    def test_starts_from_perfect_rest_and_ends_on_either_side(self):
        controller = design_swing_up(QUBE)
        for q2 in (np.pi, -np.pi, 5 * np.pi):
            run = simulate(QUBE, controller, 8.0, x0=(0.0, q2, 0.0, 0.0))
            assert abs(np.cos(run.state[-250:, 1]) - 1).max() < 0.01
            assert controller.balancing

    def test_swings_up_anew_after_a_fall(self):
        controller = design_swing_up(QUBE)
        run = simulate(QUBE, controller, 10.0, x0=(0.0, 1.4, 0.0, 8.0))
        assert np.cos(run.state[:, 1]).min() < -0.9
        assert abs(np.cos(run.state[-250:, 1]) - 1).max() < 0.01

    def test_region_shrinks_with_the_motor_and_holds_inside(self):
        levels = {}
        for u_max in (2.0, 10.0):
            rig = QUBE.replace(u_max=u_max)
            weights = Weights.of(QUBE)
            balancer = design_dlqr(rig, weights=weights)
            region = region_of_attraction(balancer, rig, choose_sensors(rig, None), weights, tries=200)
            levels[u_max] = region.level
            # fresh starts inside the region
            rng = np.random.default_rng(11)
            x0 = np.vstack([np.zeros(100), rng.standard_normal((3, 100))])
            x0 *= np.sqrt(0.95 * rng.uniform(size=100) / region.value(x0))
            starts = Starts(x0, np.zeros(100), np.zeros(100))
            assert run_trials(rig, balancer, starts, 3.0, 0.004).success.mean() >= 0.97
        assert levels[2.0] < 0.5 * levels[10.0]


def test_excited_reference_of_the_paper_rig_stays_upright():
    """A slow wide sweep of the arm, as an identification experiment wants it."""
    controller = make_controller("lqg", TABLE_3, 0.002, reference=lambda t: 1.0 * np.sin(0.6 * t))
    run = simulate(TABLE_3, controller, 20.0, 0.002)
    assert np.abs(run.state[:, 1]).max() < 0.2
    assert np.ptp(run.state[:, 0]) > 1.5
