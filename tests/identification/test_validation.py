"""The gap on held-out logs: one for the true plant, growing with what is missing, closed by adding it."""

from __future__ import annotations

import json

import numpy as np
import pytest

from furuta_gym.plant import TABLE_3, Effect
from identification.logs import read_logs
from identification.validation import closed_fraction, validate
from tests.identification.test_prediction_error import simulated

NAMES = "rms_q1 rms_q2 fit_percent_q1 fit_percent_q2 horizon_s noise_floor_q1 noise_floor_q2 ratio_to_floor"


def spring(k: float):
    return TABLE_3.with_effects(Effect("arm_spring", {"k": k, "q1n": 0.3}))


@pytest.mark.parametrize("T", [0.002, 0.005])
def test_the_true_plant_is_at_the_floor(T: float) -> None:
    gap = validate(TABLE_3, simulated(5, T=T))
    assert 0.8 < gap.ratio_to_floor < 1.15
    assert set(NAMES.split()) <= set(gap.to_dict()["gap"])
    json.dumps(gap.to_dict(), allow_nan=False)


def test_the_gap_grows_with_what_is_missing_and_closes() -> None:
    ratios = [validate(TABLE_3, simulated(5, spring(k))).ratio_to_floor for k in (0.02, 0.1, 0.4)]
    assert 1.05 < ratios[0] < ratios[1] < ratios[2]
    log = simulated(5, spring(0.4))
    closed = closed_fraction(validate(TABLE_3, log), validate(spring(0.4), log))
    assert closed.value > 0.98
    assert closed.interval[0] < closed.value <= closed.interval[1] + 1e-9
    none = closed_fraction(validate(TABLE_3, log), validate(TABLE_3, log))
    assert none.value == pytest.approx(0.0, abs=1e-12)


def test_gaps_of_different_logs_are_not_compared() -> None:
    a, b = validate(TABLE_3, simulated(5)), validate(TABLE_3, simulated(5, duration=6.0))
    with pytest.raises(ValueError, match="same"):
        closed_fraction(a, b)


def test_too_short_logs_are_refused() -> None:
    with pytest.raises(ValueError, match="long"):
        validate(TABLE_3, simulated(5).slice(0.0, 0.4))


def test_measured_logs(real_data) -> None:
    mapping = {"pendulum_zero": "hanging", "flip": "q2", "encoder_counts": 2048}
    from identification.identify import identify

    fitted = read_logs([real_data / f"qube_darmstadt/chirp_{s}1V5_250Hz_00.csv" for s in "pm"], **mapping)
    held = read_logs([real_data / "qube_darmstadt/swingup_250Hz_10s_00.csv"], **mapping)
    estimate = identify(fitted)
    assert 0.04 < estimate.plant.theta[0] < 0.08
    assert 2.5 < estimate.plant.theta[4] < 4.0
    assert any("lack" in w or "misses" in w for w in estimate.warnings), "this rig has effects that model (5) lacks"
    gap = validate(estimate.plant, held)
    assert np.isfinite(gap.rms).all()
    assert gap.ratio_to_floor > 1.5
