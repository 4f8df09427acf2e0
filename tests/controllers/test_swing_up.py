"""The designed swing-up: it predicts the rig over the delay of the command, keeps its travel, and tries again."""

import numpy as np
import pytest

from controllers import make_controller
from controllers.base import DesignError
from controllers.comparison.trials import run_trials, swing_up_starts
from controllers.design import Weights, choose_sensors
from controllers.exports.c import c_header
from controllers.swing_up.energy import Pumping, SwingUp, catch_region, design_swing_up
from controllers.swing_up.predictor import Predictor
from furuta_gym.plant import QUBE, Effect, Plant
from furuta_gym.sensors import FilteredDifference, Sensors
from furuta_gym.simulation import simulate

T = 0.004
LATE = QUBE.with_effects(Effect("input_delay", {"d": 0.010}), Effect("actuator_lag", {"T": 0.008}))


class Watched:
    """Plays given commands and asks a predictor each sample for the state at which they take hold."""

    sample_time = T

    def __init__(self, predictor: Predictor, commands: np.ndarray) -> None:
        self.predictor, self.commands = predictor, commands
        self.seen: list[np.ndarray] = []

    def reset(self) -> None:
        self.predictor.restart()
        self.seen = []

    def __call__(self, y: np.ndarray) -> float:
        self.predictor.update(y.reshape(2, 1))
        self.seen.append(self.predictor.ahead()[0][:, 0])
        u = self.commands[len(self.seen) - 1]
        self.predictor.send(np.array([u]))
        return float(u)


def test_the_predicted_state_is_the_one_a_delay_later() -> None:
    rng = np.random.default_rng(0)
    commands = np.repeat(rng.uniform(-4, 4, 60), 10)
    watched = Watched(Predictor(LATE, T, Sensors()), commands)
    run = simulate(LATE, watched, 2.4, T, x0=(0.0, np.pi - 0.3, 0.0, 0.0))
    seen = np.array(watched.seen)
    # the delay is two samples and a half: between the samples the truth is nearly straight
    truth = 0.5 * (run.state[2:-1] + run.state[3:])
    error = seen[:-3, :4] - truth
    settled = error[100:]
    assert np.abs(settled[:, :2]).max() < 0.012
    assert np.sqrt(np.mean(settled[:, 2:] ** 2)) < 0.25
    # a filtered difference of the readings is far behind that, and so is the state now
    difference = FilteredDifference()
    speeds = np.array([difference.update(*y, T) for y in run.measured])
    assert np.sqrt(np.mean((speeds[100:-3] - truth[100:, 2:]) ** 2)) > 8 * np.sqrt(np.mean(settled[:, 2:] ** 2))
    assert np.abs(run.state[100:-3, 1] - truth[100:, 1]).max() > 8 * np.abs(settled[:, 1]).max()


def test_a_reading_that_jumps_and_garbage_do_no_lasting_harm() -> None:
    controller = design_swing_up(LATE)
    rng = np.random.default_rng(1)
    for _ in range(300):
        assert np.isfinite(controller(rng.choice([0.0, 1e3, -1e4, 3.0], 2))).all()
    controller(np.array([0.0, np.pi]))
    for _ in range(5):
        u = controller(np.array([0.0, np.pi]))
    assert abs(u) <= LATE.u_max
    assert np.abs(controller.predictor.ahead()[0][2:4]).max() < 5.0


@pytest.mark.parametrize(
    ("effects", "u_max"),
    [
        ({"input_delay": {"d": 0.016}}, 4.0),
        ({"input_delay": {"d": 0.008}, "actuator_lag": {"T": 0.012}}, 6.0),
        ({"arm_spring": {"k": 0.3, "q1n": 0.2}, "input_dead_zone": {"w": 0.2}}, 10.0),
    ],
    ids=["late and weak", "late and lagged", "cable and dead zone"],
)
def test_it_swings_up_what_it_knows(effects: dict[str, dict[str, float]], u_max: float) -> None:
    rig = QUBE.replace(u_max=u_max).with_effects(*(Effect(name, p) for name, p in effects.items()))
    outcome = played(rig, design_swing_up(rig), 40)
    assert outcome.success.mean() >= 0.95
    assert outcome.largest_q1.max() < 5.5


def test_a_rig_of_a_kilohertz_that_hangs_still_is_swung_up() -> None:
    """The first push moves the arm by less than a count in a sample, and must not turn with the sign of its angle."""
    controller = make_controller("swing-up", QUBE, 0.001, Sensors(2048))
    run = simulate(QUBE, controller, 6.0, 0.001, x0=(0.0, np.pi, 0.0, 0.0))
    assert np.abs(np.angle(np.exp(1j * run.state[-500:, 1]))).max() < 0.1
    assert np.abs(np.diff(np.sign(run.command[:50]))).sum() <= 2


def test_who_does_not_know_the_delay_fails_at_it() -> None:
    late = QUBE.replace(u_max=4.0).with_effects(Effect("input_delay", {"d": 0.024}))
    assert played(late, design_swing_up(QUBE.replace(u_max=4.0)), 20).success.mean() < 0.5
    assert played(late, design_swing_up(late), 20).success.mean() >= 0.95


def test_the_arm_keeps_its_travel() -> None:
    narrow = QUBE.replace(limits={"arm_travel": 2.0})
    outcome = played(narrow, design_swing_up(narrow), 40, travel=2.0)
    assert outcome.success.all()
    free = played(QUBE, design_swing_up(QUBE), 40)
    assert outcome.largest_q1.max() < 2.0 < free.largest_q1.max()


def test_it_tries_another_way_when_the_energy_does_not_grow() -> None:
    weak = QUBE.replace(u_max=4.0)
    sensors, weights = choose_sensors(weak, None), Weights.of(weak)
    region = catch_region(weak, T, sensors, weights)
    useless = Pumping(swing=0.02, centring=0.3, excess=0.02)
    good = design_swing_up(weak).ways[0]

    def up(*ways: Pumping) -> float:
        return played(weak, SwingUp(weak, T, sensors, weights, region, ways), 10).success.mean()

    assert up(useless) == 0.0
    assert up(useless, good) == 1.0


def test_it_has_no_gain_and_no_c_export() -> None:
    assert make_controller("swing-up", QUBE).feedback_gain is None
    with pytest.raises(ValueError, match=r"swing-up is not linear and has no C export; lqr"):
        c_header(make_controller("swing-up", QUBE))


def played(rig: Plant, controller: SwingUp, trials: int, travel: float = 2 * np.pi):
    starts = swing_up_starts(trials, np.random.default_rng(3))
    return run_trials(rig, controller, starts, 15.0, T, swing_up=True, arm_travel=travel)


def test_the_observer_knows_what_the_slew_limit_let_pass() -> None:
    slow = QUBE.replace(limits={"slew": 150.0})
    controller = design_swing_up(slow)
    run = simulate(slow, controller, 3.0, T, x0=(0.1, np.pi - 0.1, 0.0, 0.0))
    asked = []
    controller.reset()
    for y in run.measured:
        asked.append(controller(y))
    assert np.abs(np.diff(asked)).max() <= 150.0 * T * (1 + 1e-9)
    assert np.abs(np.diff(asked)).max() > 149.0 * T
    assert np.array(asked) == pytest.approx(run.command[: len(asked)], abs=1e-6)


@pytest.mark.parametrize(
    ("limits", "named"),
    [
        ({"slew": 0.5}, "the limit slew, 0.5 V/s,"),
        ({"arm_speed": 1e-3}, "the limit arm_speed, 0.001 rad/s,"),
        (None, "10 V,"),
    ],
)
def test_a_plant_that_cannot_be_held_names_its_limits(limits, named: str) -> None:
    with pytest.raises(DesignError, match=f"close to upright: .*{named} may be too small") as said:
        design_swing_up(QUBE.replace(limits=limits) if limits else QUBE.replace(u_max=10.0), 0.2)
    assert ("limit" in str(said.value)) == bool(limits)
