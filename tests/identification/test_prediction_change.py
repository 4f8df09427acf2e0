"""What a torque changes of a prediction, against runs of the plant with and without it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from furuta_gym.plant import TABLE_3, Effect
from identification.discrepancy.prediction_change import prediction_change
from identification.kalman.noise import fit_noise
from identification.kalman.record import Record
from identification.validation.free_run import Windows, free_run
from tests.factories import loop_log

HORIZON = 0.3


@pytest.mark.parametrize("offset", [0.02, -0.05])
def test_a_constant_torque_moves_predictions_by_as_much_as_it_says(offset: float) -> None:
    """The truth's filtered states predicted with the plant and with the offset: the difference is what is asked for."""
    log, _ = loop_log(duration=6.0)
    path = fit_noise(TABLE_3, Record.from_log(log)).path
    windows = Windows.over(log.t, (HORIZON,), 0.5)
    pushed = fit_noise(TABLE_3.with_effects(Effect("input_offset", {"b": offset})), Record.from_log(log)).path
    same_start = replace(pushed, filtered=path.filtered)
    apart = free_run(path, windows)[:, 0] - free_run(same_start, windows)[:, 0]
    torque = np.tile([offset, 0.0], (len(log), 1))
    found = prediction_change(path, torque, np.zeros_like(torque), HORIZON)
    assert np.sqrt(found) == pytest.approx(np.sqrt(np.mean(apart**2, axis=0)), rel=0.1)


def test_an_error_of_a_reading_that_does_not_change_changes_nothing() -> None:
    log, _ = loop_log(duration=3.0)
    path = fit_noise(TABLE_3, Record.from_log(log)).path
    nothing, zero = np.zeros((len(log), 2)), np.tile([0.1, 0.0], (len(log), 1))
    assert prediction_change(path, nothing, zero, HORIZON) == pytest.approx([0.0, 0.0])
    drift = 0.1 * (log.t - log.t[0])[:, None] * [1.0, 0.0]
    found = prediction_change(path, nothing, drift, HORIZON)
    assert np.sqrt(found) == pytest.approx([0.1 * HORIZON, 0.0], rel=0.02)


def test_of_a_log_that_is_too_short_there_is_nothing_to_say() -> None:
    log, _ = loop_log(duration=3.0)
    path = fit_noise(TABLE_3, Record.from_log(log)).path
    assert prediction_change(path, np.ones((len(log), 2)), np.zeros((len(log), 2)), 5.0) == pytest.approx([0.0, 0.0])
