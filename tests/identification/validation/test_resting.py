"""The floor of logs in which an angle rests or creeps: the right plant is not called wrong, nor a wrong one right."""

from __future__ import annotations

import numpy as np
import pytest

from furuta_gym.plant import QUBE
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import open_loop, simulate
from identification.diagnosis.locate.locate import locate
from identification.logs.log import Log
from identification.validation.gap import Gap, validate


def hanging(amplitude: float, hertz: float, start: float = np.pi) -> Log:
    """A QUBE that hangs under a sine, with encoders of 2048 counts and no other noise."""
    T = 0.004
    u = amplitude * np.sin(2 * np.pi * hertz * T * np.arange(2500))
    run = simulate(QUBE, open_loop(u), 10.0, T, Sensors(2048), x0=(0, start, 0, 0), longest_step=5e-4)
    return Log.from_run(run, QUBE.unit, 2048)


STICKY = QUBE.replace(theta=QUBE.theta * [1, 1, 1, 1, 1, 1, 2, 8, 4])


def pulses(seed: int, counts: int) -> Log:
    """A sticky rig that hangs, with pulses and pauses in which its arm rests, encoders and no other noise."""
    T, rng = 0.004, np.random.default_rng(seed)
    sizes = rng.choice([-1, 1], 10) * rng.uniform(1.5, 3.0, 10)
    u = np.concatenate([np.repeat([size, 0.0], [75, 400]) for size in sizes])
    run = simulate(STICKY, open_loop(u), T * len(u), T, Sensors(counts), x0=(0.1, np.pi, 0, 0), longest_step=5e-4)
    return Log.from_run(run, STICKY.unit, counts)


def gap(log: Log) -> Gap:
    return validate(QUBE, log)


@pytest.mark.parametrize(("amplitude", "hertz"), [(0.15, 0.2), (0.2, 0.05)])
def test_a_right_plant_on_a_log_that_rests_at_times_is_at_the_floor(amplitude: float, hertz: float) -> None:
    found = gap(hanging(amplitude, hertz))
    assert found.resting.max() > 0.5
    assert found.ratio_to_floor == pytest.approx(1.0, abs=0.12)


@pytest.mark.parametrize("counts", [512, 2048])
@pytest.mark.parametrize("seed", [0, 1])
def test_pulses_with_pauses_leave_nothing_and_a_low_floor(seed: int, counts: int) -> None:
    """Their starts and stops are no torque noise: that would raise the floor tenfold, and look like structure."""
    log = pulses(seed, counts)
    found = validate(STICKY, log)
    assert found.resting[0] > 0.2
    assert found.ratio_to_floor == pytest.approx(1.0, abs=0.1)
    assert np.all(found.floor < 0.4 * found.counts)
    assert not locate(STICKY, log).matters


def test_a_right_plant_on_a_log_that_stays_within_some_counts_is_not_judged() -> None:
    found = gap(hanging(0.1, 1.0))
    assert found.resting.max() > 0.95
    assert found.verdict.startswith("this says little: the floor is not to be trusted, as q")
    assert "the plant misses something" not in str(found)
    assert found.to_dict()["gap"]["resting_share_q2"] == found.resting[1]


def test_a_right_plant_on_a_log_that_moves_is_judged_as_before() -> None:
    found = gap(hanging(1.5, 1.0))
    assert found.ratio_to_floor == pytest.approx(1.0, abs=0.05)
    assert found.resting.max() < 0.02
    assert "trusted" not in str(found)
    assert "nothing of size is missing" in str(found)


def test_a_wrong_plant_is_still_found_where_an_angle_creeps() -> None:
    found = validate(QUBE.replace(theta=QUBE.theta * [1, 1, 1, 1, 1, 1, 1, 0.5, 1]), hanging(0.2, 0.05))
    assert found.ratio_to_floor > 4.0
    assert "the plant misses something" in found.verdict


def test_readings_that_are_not_rounded_do_not_rest() -> None:
    log = hanging(0.1, 1.0)
    rng = np.random.default_rng(0)
    noisy = Log(log.t, *(log.angles + 1e-4 * rng.normal(size=(len(log), 2))).T, log.u, input_unit=log.input_unit)
    assert gap(noisy).resting.max() == 0.0
