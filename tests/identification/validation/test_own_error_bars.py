"""What the error bars of a plant alone let one expect of its predictions."""

from __future__ import annotations

import numpy as np
import pytest

from furuta_gym.plant import TABLE_3, Plant
from furuta_gym.plant.covariance import Covariance
from furuta_gym.plant.sampling import sampled_plants
from identification.kalman.path import FilterPath
from identification.validation import own_error_bars
from identification.validation.free_run import Windows, free_run
from identification.validation.gap import validate
from identification.validation.own_error_bars import expected_ratio, told
from tests.factories import open_loop_log


def known_within(share: float) -> Plant:
    """Table 3 whose θ5 is known within this share of it."""
    return TABLE_3.replace(covariance=Covariance(("theta5",), np.array([[(share * TABLE_3.theta[4]) ** 2]])))


def test_wide_error_bars_explain_an_error_and_narrow_ones_do_not(monkeypatch: pytest.MonkeyPatch) -> None:
    t = np.arange(1500) * 0.004
    rig = TABLE_3.replace(theta=TABLE_3.theta * [1, 1, 1, 1, 1.03, 1, 1, 1, 1])
    log = open_loop_log(0.5 * np.sin(2 * np.pi * (0.3 + 0.2 * t) * t), torque_noise=(1e-7, 1e-9), plant=rig)
    gap = validate(TABLE_3, log)
    ratio = gap.ratio_to_floor
    assert ratio > 2.0
    wide, narrow = (expected_ratio(known_within(share), [log], gap) for share in (0.03, 0.001))
    assert wide is not None
    assert narrow is not None
    assert "nothing need be missing" in told(ratio, wide)
    assert told(ratio, narrow) == ""
    assert expected_ratio(TABLE_3, [log], gap) is None  # no error bars
    drawn = sampled_plants(known_within(0.03), own_error_bars.DRAWS, np.random.default_rng(0))
    deviations = np.array([plant.theta[4] / TABLE_3.theta[4] - 1.0 for plant in drawn]) / 0.03
    monkeypatch.setattr(own_error_bars, "sampled_plants", lambda *_: [rig])  # off by one standard deviation
    off = expected_ratio(known_within(0.03), [log], gap)
    assert off is not None
    assert off**2 - 1.0 == pytest.approx(ratio**2 - 1.0, rel=0.3)
    assert wide**2 - 1.0 == pytest.approx(np.mean(deviations**2) * (off**2 - 1.0), rel=0.1)


def test_what_error_bars_explain_scatters_as_one_parameter_does() -> None:
    expected = 3.0
    errors = np.sqrt(1.0 + (expected**2 - 1.0) * np.random.default_rng(0).standard_normal(10_000) ** 2)
    assert np.mean([told(ratio, expected) != "" for ratio in errors]) == pytest.approx(0.95, abs=0.01)


def test_nothing_is_predicted_across_a_gap_of_the_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two seconds without samples: a run over them would end anywhere, and excuse any error."""
    monkeypatch.setattr(own_error_bars, "DRAWS", 8)
    t = np.arange(2500) * 0.004
    log = open_loop_log(0.5 * np.sin(2 * np.pi * (0.3 + 0.1 * t) * t), torque_noise=(1e-7, 1e-9))
    cut = log.taken((log.t < 4.0) | (log.t > 6.0))
    gap = validate(TABLE_3, cut)
    apart, together = (expected_ratio(known_within(0.03), logs, gap) for logs in (cut.pieces(), [cut]))
    assert apart is not None
    assert together == pytest.approx(apart, rel=0.05)


def test_runs_that_leave_all_bounds_expect_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def lost(path: FilterPath, windows: Windows) -> np.ndarray:
        errors = free_run(path, windows)
        if path.plant.theta[4] < TABLE_3.theta[4]:
            errors[::2] = np.inf
        return errors

    t = np.arange(1000) * 0.004
    log = open_loop_log(0.5 * np.sin(2 * np.pi * (0.3 + 0.2 * t) * t), torque_noise=(1e-7, 1e-9))
    gap = validate(TABLE_3, log)
    monkeypatch.setattr(own_error_bars, "DRAWS", 4)
    monkeypatch.setattr(own_error_bars, "free_run", lost)
    found = expected_ratio(known_within(0.03), [log], gap)
    assert found is not None
    assert np.isfinite(found)
