"""A plant that goes on sample by sample moves as `simulate` moves it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from furuta_gym import LivePlant, Sensors, simulate
from furuta_gym.plant import QUBE, TABLE_3, Effect
from furuta_gym.simulation import open_loop
from tests.factories import PaperPolicy

LATE = TABLE_3.with_effects(TABLE_3.default_effect("input_delay"), TABLE_3.default_effect("actuator_lag"))
START = (0.0, 0.02, 0.0, 0.0)


def played(live: LivePlant, samples: int) -> np.ndarray:
    policy = PaperPolicy(live.sample_time)
    policy.reset()
    states = []
    for _ in range(samples):
        states.append(live.state)
        live.step(policy(live.read()))
    return np.array(states)


@pytest.mark.parametrize("kept", [64, 4096])
def test_it_moves_as_simulate_moves_it_also_where_old_commands_are_forgotten(kept: int) -> None:
    run = simulate(LATE, PaperPolicy(0.002), 1.0, 0.002, Sensors(), x0=START)
    live = LivePlant(LATE, 0.002, Sensors(), START, samples=kept)
    np.testing.assert_allclose(played(live, len(run)), run.state, rtol=0, atol=1e-12)
    assert live.t == pytest.approx(1.0)


def test_a_delay_of_many_samples_is_kept_in_mind() -> None:
    late = TABLE_3.with_effects(Effect("input_delay", {"d": 0.05}))  # of 5000 samples
    run = simulate(late, open_loop(1.0), 0.054, 1e-5, x0=START)
    live = LivePlant(late, 1e-5, x0=START)
    for state in run.state:
        np.testing.assert_allclose(live.state, state, rtol=0, atol=1e-12)
        live.step(1.0)


def test_the_encoders_of_the_plant_file_are_the_default() -> None:
    rig = QUBE.replace(sensors={"offset": [0.3, 0.02], "encoder_counts": 512, "noise_std": 1e-3})
    own = Sensors.of_file(rig.sensors)
    told, given = (simulate(rig, open_loop(), 0.1, sensors=sensors, x0=(0, np.pi, 0, 0)) for sensors in (None, own))
    np.testing.assert_array_equal(told.measured, given.measured)
    assert told.measured[0] == pytest.approx([0.3, np.pi + 0.02], abs=0.02)
    assert LivePlant(rig).sensors == own
    assert LivePlant(rig, sensors=Sensors(1024)).sensors == Sensors(1024)
    assert LivePlant(QUBE).sensors == Sensors()


def test_a_torque_pushes_its_own_row() -> None:
    for row in (0, 1):
        live = LivePlant(TABLE_3, 0.002)
        live.step(0.0, (0.5, 0.0) if row == 0 else (0.0, 0.5))
        M = TABLE_3.theta
        mass = np.array([[M[0], M[2]], [M[2], M[3]]])  # upright: sin q2 = 0
        assert live.state[2:] / 0.002 == pytest.approx(np.linalg.solve(mass, np.eye(2)[row] * 0.5), rel=0.25)


def test_another_plant_takes_over_the_motion() -> None:
    live = LivePlant(TABLE_3, 0.002, x0=START)
    played(live, 50)
    before = live.state
    live.exchange(LATE)
    assert (live.state == before).all()
    live.step(1.0)
    live.exchange(TABLE_3.with_effects(TABLE_3.default_effect("arm_spring")))
    live.step(0.0)
    assert np.isfinite(live.state).all()


def test_an_effect_that_stays_keeps_its_memory_whatever_comes_beside_it() -> None:
    names = ("actuator_lag", "arm_presliding", "arm_hysteresis")
    carrying = TABLE_3.with_effects(*map(TABLE_3.default_effect, names))
    live, twin = (LivePlant(carrying, 0.002, x0=START) for _ in range(2))
    played(live, 50)
    played(twin, 50)
    live.exchange(carrying.with_effects(TABLE_3.default_effect("arm_backlash")))  # it remembers as well
    live.exchange(carrying)
    played(live, 20)
    played(twin, 20)
    np.testing.assert_array_equal(live.state, twin.state)
    live.exchange(TABLE_3)
    live.exchange(carrying)
    played(live, 20)
    played(twin, 20)
    assert (live.state != twin.state).any(), "what went has forgotten"


def test_what_leaves_all_bounds_is_said() -> None:
    live = LivePlant(TABLE_3, 0.002)
    with pytest.raises(FloatingPointError, match="leaves all bounds"):
        live.step(0.0, (1e9, 0.0))


@pytest.mark.parametrize(
    ("duration", "noise", "message"),
    [
        (math.inf, (0.0, 0.0), "must be finite"),
        (1e9, (0.0, 0.0), "expected at most 20000000"),
        (1.0, (-1.0, 0.0), "torque_noise must be two finite numbers"),
    ],
)
def test_a_run_that_cannot_be_is_refused_at_once(duration: float, noise: tuple[float, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        simulate(TABLE_3, lambda y: 0.0, duration, 0.002, torque_noise=noise)


@pytest.mark.parametrize(
    ("given", "word"),
    [
        ({"x0": (0.0, 0.0)}, "x0"),
        ({"x0": (0.0, math.nan, 0.0, 0.0)}, "x0"),
        ({"longest_step": 0.0}, "longest_step"),
        ({"longest_step": -1.0}, "longest_step"),
        ({"sample_time": 0.0}, "sample_time"),
        ({"sample_time": math.nan}, "sample_time"),
        ({"q2_limit": math.nan}, "q2_limit"),
    ],
)
def test_a_run_that_cannot_be_is_refused(given: dict[str, Any], word: str) -> None:
    with pytest.raises(ValueError, match=word):
        simulate(QUBE, open_loop(), 0.1, **given)


@pytest.mark.parametrize("values", [[], math.nan])
def test_a_command_of_no_value_is_refused(values: Any) -> None:
    with pytest.raises(ValueError, match="values"):
        open_loop(values)


def test_a_controller_whose_command_is_nan_is_told_when() -> None:
    commands = iter([1.0, 1.0, math.nan])
    with pytest.raises(ValueError, match=r"command at t = 0\.008 s is NaN; check the controller"):
        simulate(QUBE, lambda y: next(commands), 0.1, 0.004)


def test_a_step_that_is_asked_too_short_is_said_to_be_the_cause() -> None:
    with pytest.raises(ValueError, match=r"longest_step is 1e-08 s\. Raise it"):
        simulate(QUBE, open_loop(), 0.1, 0.004, longest_step=1e-8)


def test_a_value_of_an_excitation_that_is_not_finite_is_named() -> None:
    d = np.zeros(25)
    d[3] = math.nan
    with pytest.raises(ValueError, match=r"finite numbers, got nan at t = 0\.012 s"):
        simulate(QUBE, open_loop(), 0.1, 0.004, excitation=d)
    with pytest.raises(ValueError, match=r"one number a sample: \(25,\), got \(24,\)"):
        simulate(QUBE, open_loop(), 0.1, 0.004, excitation=d[1:])
