"""The floor of logs in which an angle rests or creeps: the right plant is not called wrong, nor a wrong one right."""

from __future__ import annotations

import numpy as np
import pytest

from furuta_gym.plant import QUBE
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import open_loop, simulate
from identification.logs.log import Log
from identification.validation.gap import Gap, validate


def hanging(amplitude: float, hertz: float, start: float = np.pi) -> Log:
    """A QUBE that hangs under a sine, with encoders of 2048 counts and no other noise."""
    T = 0.004
    u = amplitude * np.sin(2 * np.pi * hertz * T * np.arange(2500))
    run = simulate(QUBE, open_loop(u), 10.0, T, Sensors(2048), x0=(0, start, 0, 0), longest_step=5e-4)
    return Log.from_run(run, QUBE.unit, 2048)


def gap(log: Log) -> Gap:
    return validate(QUBE, log)


@pytest.mark.parametrize(("amplitude", "hertz"), [(0.15, 0.2), (0.2, 0.05), (0.1, 1.0)])
def test_a_right_plant_on_a_log_that_creeps_is_not_judged(amplitude: float, hertz: float) -> None:
    found = gap(hanging(amplitude, hertz))
    assert not 0.9 < found.ratio_to_floor < 1.1
    assert found.resting.max() > 0.3
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
    assert "The floor is not to be trusted" in str(found)


def test_readings_that_are_not_rounded_do_not_rest() -> None:
    log = hanging(0.1, 1.0)
    rng = np.random.default_rng(0)
    noisy = Log(log.t, *(log.angles + 1e-4 * rng.normal(size=(len(log), 2))).T, log.u, input_unit=log.input_unit)
    assert gap(noisy).resting.max() == 0.0
