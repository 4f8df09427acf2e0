"""A command that does not do the same all along a log is told; what else may change is not taken for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from experiments.bench import HiddenEffect, Rig
from furuta_gym.plant import TABLE_3
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import simulate
from identification.design.signals import paper_signal
from identification.estimation.identify import identify
from identification.logs.log import Log
from tests.factories import TORQUE_NOISE, PaperPolicy, bench_log, loop_log

DURATION, T = 8.0, 0.004


def changing(gain: Callable[[float], float]) -> Log:
    """Table 3 under the paper's experiment; the motor gives `gain`(t) times the command that the log has."""
    loop, signal = PaperPolicy(T), paper_signal()
    clock = iter(np.arange(0.0, 2 * DURATION, T))

    def motor(y: np.ndarray) -> float:
        t = next(clock)
        return gain(t) * (loop(y) + float(signal(t)))

    run = simulate(TABLE_3, motor, DURATION, T, Sensors(4096), torque_noise=TORQUE_NOISE, longest_step=5e-4)
    log = Log.from_run(run, TABLE_3.unit, 4096, "sagging.csv")
    return replace(log, t=log.t + 3.0, u=log.u / np.array([gain(t) for t in log.t]))


def test_a_supply_that_sags_is_told_with_its_factor() -> None:
    estimate = identify(changing(lambda t: 1.0 - 0.25 * t / DURATION))
    (change,) = estimate.gain_changes
    assert change.factor == pytest.approx(0.75, abs=0.04)
    assert change.since is None
    said = str(estimate)
    assert "! the command does about 0.7" in said
    assert "at the end of sagging.csv as at its beginning" in said
    assert "all parameters identified" not in said
    assert "θ is a mean, as the command did not do the same all along" in estimate.verdict
    assert any("at the end of sagging.csv" in text for text in estimate.to_dict()["warnings"])


@pytest.mark.parametrize("at", [0.35, 0.5])
def test_a_step_is_told_with_its_time_by_the_logs_clock(at: float) -> None:
    (change,) = identify(changing(lambda t: 1.0 if t < at * DURATION else 0.9)).gain_changes
    assert change.factor == pytest.approx(0.9, abs=0.02)
    assert change.since == pytest.approx(3.0 + at * DURATION, abs=0.1)


@pytest.mark.parametrize("effect", ["", "arm_friction_drift", "input_delay", "arm_spring", "payload_step"])
def test_what_else_a_rig_may_have_is_not_taken_for_it(effect: str) -> None:
    rig = Rig("servo", [HiddenEffect(effect, 2.0)] if effect else [])
    assert identify(bench_log(rig, "paper", 2, 8.0)).gain_changes == ()


def test_a_right_model_keeps_its_verdict() -> None:
    estimate = identify(loop_log(T=T, duration=DURATION)[0])
    assert estimate.gain_changes == ()
    assert "all parameters identified" in estimate.verdict
