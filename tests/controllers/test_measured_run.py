"""Figures of a measured run are those of trials, where both can be had."""

from __future__ import annotations

import numpy as np
import pytest

from controllers import make_controller
from controllers.comparison.measured_run import run_figures
from controllers.comparison.trials import Starts, run_trials
from furuta_gym.plant import QUBE
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import LivePlant

T = 0.004
EXACT = Sensors(encoder_counts=0, noise_std=0.0)


def played(x0, seconds: float, name: str = "lqr"):
    """Columns of a run without any noise, one more reading than commands that acted."""
    controller, rig, rows = make_controller(name, QUBE, T, EXACT), LivePlant(QUBE, T, EXACT, x0=x0), []
    controller.reset()
    for _ in range(round(seconds / T) + 1):
        y = rig.read()
        u = controller(y)
        rows.append((rig.t, *y, u))
        rig.step(u)
    return np.array(rows).T


@pytest.mark.parametrize(
    ("name", "x0", "seconds"), [("lqr", (0.3, 0.05, 0.0, 0.0), 4.0), ("swing-up", (0.1, np.pi, 0.0, 0.0), 9.0)]
)
def test_the_figures_are_those_of_a_trial(name, x0, seconds) -> None:
    t, q1, q2, u = played(x0, seconds, name)
    swing_up = name == "swing-up"
    found = run_figures(t, q1, q2, u, swing_up=swing_up)
    starts = Starts(np.array(x0)[:, None], np.zeros(1), np.zeros(1))
    trial = run_trials(QUBE, make_controller(name, QUBE, T, EXACT), starts, seconds, T, EXACT, swing_up=swing_up)
    assert found.success
    assert trial.success[0]
    for figure in ("rms_q1", "rms_q2", "energy", "roughness", "settling", "largest_q1"):
        assert getattr(found, figure) == pytest.approx(getattr(trial, figure)[0], rel=0.02, abs=2e-3), figure


def test_a_pendulum_that_falls_has_figures_up_to_its_fall() -> None:
    t = np.arange(500) * T
    q1, u = np.full(500, 0.2), np.ones(500)
    q2 = np.where(t < 1.0, 0.01, 2.0)
    found = run_figures(t, q1, q2, u)
    assert not found.success
    assert found.failed_at == pytest.approx(1.0, abs=T)
    assert found.rms_q2 == pytest.approx(0.01)
    assert found.mean_q1 == pytest.approx(0.2)
    assert found.energy == pytest.approx(1.0, abs=2 * T)
    assert found.settling is None
    assert "for 1.00 s (tilt)" in str(found)


def test_an_arm_beyond_its_travel_has_failed() -> None:
    t = np.arange(500) * T
    found = run_figures(t, 2.0 * t, 0.0 * t, 0.0 * t, arm_travel=1.0)
    assert found.failed_at == pytest.approx(0.5, abs=2 * T)
    assert found.why == "arm"
    assert run_figures(t, 2.0 * t, 0.0 * t, 0.0 * t).success
    assert run_figures(t, 2.0 * t, 0.0 * t, 0.0 * t).why is None
    assert run_figures(t, 2.0 * t, 0.0 * t, 0.0 * t, arm_speed=1.0).why == "speed"


def test_a_swing_up_that_does_not_end_upright_says_so() -> None:
    t = np.arange(round(8.0 / T)) * T
    assert run_figures(t, 0.0 * t, np.full(t.size, np.pi), 0.0 * t, swing_up=True).why == "not upright"


def test_lost_samples_and_an_uneven_clock_hardly_change_the_figures() -> None:
    t, q1, q2, u = played((0.3, 0.05, 0.0, 0.0), 4.0)
    rng = np.random.default_rng(0)
    kept = rng.random(t.size) > 0.02
    kept[[0, -1]] = True
    jittered = t + 0.1 * T * rng.uniform(-1, 1, t.size)
    whole, part = run_figures(t, q1, q2, u), run_figures(jittered[kept], q1[kept], q2[kept], u[kept])
    for figure in ("rms_q1", "rms_q2", "mean_q1", "energy", "settling", "largest_q1"):
        assert getattr(part, figure) == pytest.approx(getattr(whole, figure), rel=0.05, abs=2e-3), figure


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"q2": np.full(500, np.nan)}, "not finite"),
        ({"u": np.zeros(400)}, "one length"),
        ({"t": np.r_[np.arange(250), np.arange(300, 550)] * T}, "step of"),
        ({k: np.zeros(2) for k in ("t", "q1", "q2", "u")}, "3 or more"),
    ],
)
def test_what_is_no_run_is_refused(change, said) -> None:
    columns = {"t": np.arange(500) * T} | {k: np.zeros(500) for k in ("q1", "q2", "u")}
    with pytest.raises(ValueError, match=said):
        run_figures(**(columns | change))


@pytest.mark.parametrize(("samples", "sample_time"), [(500, T), (2500, 0.0020000000000000018)])
def test_a_swing_up_no_longer_than_its_hold_is_refused(samples: int, sample_time: float) -> None:
    zeros = np.zeros(samples)
    with pytest.raises(ValueError, match="stay upright"):
        run_figures(np.arange(samples) * sample_time, zeros, zeros, zeros, swing_up=True)


def test_a_pendulum_that_sways_for_ever_has_not_settled() -> None:
    t = np.arange(1001) * T
    sways = run_figures(t, 0.0 * t, 0.08 * np.sin(2 * np.pi * t), np.ones_like(t))  # it passes upright at the end
    assert sways.success
    assert sways.settling is None
    assert run_figures(t, 0.0 * t, np.where(t < 2.0, 0.08, 0.0), np.ones_like(t)).settling == pytest.approx(2.0)
