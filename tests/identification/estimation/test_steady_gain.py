"""A command that does not do the same all along a log is told; what else may change is not taken for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from experiments.bench import HiddenEffect, Rig
from furuta_gym.plant import TABLE_3, THETA_NAMES
from identification.estimation.identify import identify
from identification.logs.log import Log
from tests.factories import bench_log, changing_gain_log, loop_log

DURATION, T = 8.0, 0.004


def changing(gain: Callable[[float], float]) -> Log:
    return changing_gain_log(gain, DURATION, T)


def test_a_supply_that_sags_is_told_with_its_factor() -> None:
    estimate = identify(changing(lambda t: 1.0 - 0.25 * t / DURATION))
    (change,) = estimate.gain_changes
    assert change.factor == pytest.approx(0.75, abs=0.04)
    assert change.since is None
    said = str(estimate)
    assert "! the command does about 0.7" in said
    assert "at the end of sagging.csv as at its beginning" in said
    assert "--effects input_gain_drift" in said
    assert "all parameters identified" not in said
    assert "θ is a mean, as the command did not do the same all along" in estimate.verdict
    assert any("at the end of sagging.csv" in text for text in estimate.to_dict()["warnings"])


def test_a_gain_that_drifts_is_fitted_as_an_effect() -> None:
    """From no drift at all: θ is that of the beginning, and no change is left to tell."""
    estimate = identify(changing(lambda t: 1.0 - 0.25 * t / DURATION), effects=["input_gain_drift"])
    names, std = list(estimate.names), estimate.std
    truth = {"input_gain_drift.a": -0.25 / DURATION} | dict(zip(THETA_NAMES, TABLE_3.theta, strict=True))
    for name, value in truth.items():
        i = names.index(name)
        assert abs(estimate.values[i] - value) < 4.0 * std[i], name
    assert std[names.index("input_gain_drift.a")] < 0.05 * 0.25 / DURATION
    assert estimate.gain_changes == ()


def test_a_log_that_does_not_follow_the_common_drift_is_told_as_that() -> None:
    steady = replace(changing(lambda t: 1.0), source="steady.csv")
    logs = [changing(lambda t: 1.0 - 0.25 * t / DURATION), steady]
    said = [str(change) for change in identify(logs, effects=["input_gain_drift"]).gain_changes]
    assert said
    assert all("beside the drift that was fitted" in text and "--effects" not in text for text in said)


@pytest.mark.parametrize("at", [0.35, 0.5])
def test_a_step_is_told_with_its_time_by_the_logs_clock(at: float) -> None:
    (change,) = identify(changing(lambda t: 1.0 if t < at * DURATION else 0.9)).gain_changes
    assert "--cut" in str(change)
    assert change.factor == pytest.approx(0.9, abs=0.02)
    assert change.since == pytest.approx(3.0 + at * DURATION, abs=0.1)


@pytest.mark.parametrize(("step", "told"), [(0.03, False), (0.06, True)])
def test_a_change_of_less_than_four_per_cent_is_not_told(step: float, told: bool) -> None:
    changes = identify(changing(lambda t: 1.0 if t < 0.5 * DURATION else 1.0 - step)).gain_changes
    assert [round(change.factor, 2) for change in changes] == ([1.0 - step] if told else [])


@pytest.mark.parametrize("effect", ["", "arm_friction_drift", "input_delay", "arm_spring", "payload_step"])
def test_what_else_a_rig_may_have_is_not_taken_for_it(effect: str) -> None:
    rig = Rig("servo", [HiddenEffect(effect, 2.0)] if effect else [])
    assert identify(bench_log(rig, "paper", 2, 8.0)).gain_changes == ()


def test_a_right_model_keeps_its_verdict() -> None:
    estimate = identify(loop_log(T=T, duration=DURATION)[0])
    assert estimate.gain_changes == ()
    assert "all parameters identified" in estimate.verdict
