"""Dropped samples: what is between two gaps is used where it can be, and a log keeps its clock and its encoders."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from furuta_gym.plant import TABLE_3, Effect
from furuta_gym.plant.effects.dispatch import read_sensors
from identification.diagnosis.locate.locate import locate
from identification.estimation.ekf import track
from identification.estimation.estimate import Estimate
from identification.estimation.identify import identify
from identification.estimation.start import reduced
from identification.kalman.record import SHORTEST, Record, sharing_counts, stretches
from identification.kalman.taken import informative
from identification.logs.checks import LogError
from identification.logs.encoders import encoder_step
from identification.logs.log import Log
from identification.validation.gap import validate
from tests.factories import loop_log


def without(log: Log, *samples: int) -> Log:
    keep = np.ones(len(log), dtype=bool)
    keep[list(samples)] = False
    return log.taken(keep)


@pytest.fixture(scope="module")
def whole() -> Estimate:
    return identify(loop_log(duration=6.0)[0], "table3")


@pytest.mark.parametrize("apart", [2, 12, 31, 50])
def test_two_dropped_samples_cost_what_is_between_them_at_most(whole: Estimate, apart: int) -> None:
    log = loop_log(duration=6.0)[0]
    broken = identify(without(log, 1000, 1000 + apart), "table3")
    assert broken.converged
    assert np.all(np.abs(broken.values[:9] - TABLE_3.theta) < 4 * broken.std[:9])
    lost = np.diag(broken.classical)[:9] / np.diag(whole.classical)[:9]
    assert np.all(lost < 1.25), lost  # each start anew has to find the speeds again
    assert validate(TABLE_3, without(log, 1000, 1000 + apart)).ratio_to_floor < 1.1
    history = track(without(log, 1000, 1000 + apart), TABLE_3)
    assert np.isfinite(history.theta).all()


def test_one_in_a_hundred_samples_dropped_at_random() -> None:
    log = loop_log(duration=10.0)[0]
    dropped = without(log, *np.random.default_rng(0).choice(np.arange(1, len(log) - 1), len(log) // 100, replace=False))
    assert min(map(len, dropped.pieces())) < SHORTEST
    estimate = identify(dropped, "table3")
    assert estimate.converged
    assert np.all(np.abs(estimate.values[:9] - TABLE_3.theta) < 4 * estimate.std[:9])


def test_much_that_is_left_out_is_told_and_all_of_it_is_refused() -> None:
    log = loop_log(duration=6.0)[0]
    half = without(log, *range(10, 1500, 12))
    with pytest.warns(UserWarning, match=r"\d+ of \d+ samples stand in stretches of fewer than 20"):
        found = stretches([half])
    assert [len(s.piece) for s in found] == [len(half.pieces()[-1])]
    with pytest.warns(UserWarning, match="stretches"), pytest.raises(LogError, match="no stretch of 20 samples"):
        stretches([without(log, *range(10, len(log), 12))])


def test_a_stretch_keeps_the_logs_clock_and_noise() -> None:
    log = loop_log(duration=6.0)[0]
    first, second = stretches([without(log, 1000)])
    assert first.record.t[0] == 0.0
    assert second.record.t[0] == pytest.approx(log.t[1001] - log.t[0])
    assert second.record.duration == pytest.approx(log.t[-1] - log.t[1001])
    np.testing.assert_array_equal(first.record.variance, second.record.variance)
    whole = Record.from_log(log)
    np.testing.assert_allclose(first.record.variance, whole.variance, rtol=0.05)
    alone = stretches([log])[0].record
    for name in ("t", "y", "u", "quantum", "variance", "velocity"):
        np.testing.assert_array_equal(getattr(alone, name), getattr(whole, name))


def test_what_follows_the_clock_goes_on_after_a_gap() -> None:
    log, plant = loop_log("payload_step", 3.0, duration=12.0)
    when = plant.effect("payload_step").parameters["t0"]
    broken = without(log, int(np.searchsorted(log.t, 0.5 * when)))
    assert validate(plant, broken).ratio_to_floor < 1.1 < validate(TABLE_3, broken).ratio_to_floor
    assert identify(broken, plant).value("payload_step.t0") == pytest.approx(when, abs=0.2)  # not 4 s off, as from zero


@pytest.mark.parametrize("at", [60, 200])
def test_a_short_stretch_does_not_stop_what_is_said_of_a_long_one(at: int) -> None:
    """At 100 Hz, 250 readings, which the tests of innovations would like, take 2.5 s."""
    log = loop_log(T=0.01, duration=12.0)[0]
    broken = without(log, at)
    assert validate(TABLE_3, broken).ratio_to_floor < 1.2
    where = locate(TABLE_3, broken)
    assert np.isfinite(where.evidence)


def test_an_axis_at_rest_takes_its_encoder_from_elsewhere() -> None:
    log = replace(loop_log(duration=4.0)[0], encoder_counts=None)
    resting = replace(log, q1=np.full(len(log), 0.3))
    step = encoder_step(log.q1)
    alone, rested = (s.record for s in stretches([log, resting]))
    assert rested.quantum[0] == pytest.approx(step)
    assert rested.variance[0] == alone.variance[0]
    single = Record.from_log(resting)  # then the other encoder tells
    assert single.quantum[0] == single.quantum[1] > 0
    assert Record.from_log(replace(resting, encoder_counts=(2048, 4096))).quantum[0] == pytest.approx(2 * np.pi / 2048)


def test_one_encoder_has_one_step_in_slow_and_fast_logs() -> None:
    """A log that moves by many counts a sample does not show their size; another log of the rig does."""
    step, t = 2 * np.pi / 2048, np.arange(0.0, 6.0, 0.01)
    rounded = lambda q: step * np.round(q / step)  # noqa: E731
    slow = Log(t, rounded(0.1 * np.sin(3 * t)), rounded(0.1 * np.cos(2 * t)), np.sin(t), source="slow.csv")
    fast = Log(t, rounded(2.0 * np.sin(9 * t)), rounded(2.5 * np.sin(13 * t)), np.sin(t), source="fast.csv")
    other = Log(t, 2.0 * np.sin(9 * t), rounded(2.5 * np.sin(13 * t)), np.sin(t), source="no counts.csv")
    assert fast.encoder_steps == (None, None)
    first, second, third = (stretch.record for stretch in stretches(sharing_counts([slow, fast, other])))
    assert first.quantum == pytest.approx([step, step], rel=1e-6)
    assert second.quantum == pytest.approx(first.quantum)
    assert third.quantum.tolist() == [0.0, 0.0]  # its arm has no counts
    assert (stretches([fast])[0].record.quantum == 0.0).all()
    assert sharing_counts([slow])[0] is slow
    told = replace(fast, encoder_counts=(4096.0, 2048.0))  # what is declared stays
    assert sharing_counts([slow, told])[1] is told


def test_a_short_race_may_keep_the_clock() -> None:
    record = Record.from_log(loop_log(duration=12.0)[0])
    at_zero, kept = reduced(record), reduced(record, clock=True)
    assert at_zero.t[0] == 0.0
    assert kept.t[0] in record.t
    np.testing.assert_allclose(kept.t - kept.t[0], at_zero.t, atol=1e-12)
    np.testing.assert_array_equal(kept.y[0], record.y[np.flatnonzero(record.t == kept.t[0])[0]])


@pytest.mark.parametrize("step", [0.001, 0.002, 0.005, 0.01])
@pytest.mark.parametrize("acceleration", [0.0, 40.0, 170.0, -300.0])
def test_the_first_velocity_is_within_its_error_where_a_log_starts_with_an_acceleration(
    acceleration: float, step: float
) -> None:
    """At 2 ms a straight line is off by 1.5 rad/s at 170 rad/s², with an error of 0.2 rad/s beside it."""
    t = step * np.arange(60)
    count = 2 * np.pi / 4096
    for speed in np.linspace(-2.0, 2.0, 9):
        path = speed * t + 0.5 * acceleration * t**2
        y = np.round(np.column_stack([path, -path]) / count) * count
        record = Record.from_arrays(t, y, np.zeros(60), [count**2 / 12.0] * 2, [count] * 2)
        assert np.abs(record.velocity - [speed, -speed]).max() < record.velocity_std < 1.0


@pytest.mark.parametrize("speed", [0.0, 7.0])
@pytest.mark.parametrize("q2", [0.1, 1.5, np.pi])
def test_the_first_state_is_that_of_the_rig_and_not_what_its_encoders_read(q2: float, speed: float) -> None:
    """Encoders off their centre by much, and off zero: one step of an iteration is 66 mrad off where it hangs."""
    rig = TABLE_3.with_effects(
        Effect("pendulum_encoder_eccentricity", {"a": -0.21, "b": -0.3}),
        Effect("arm_encoder_eccentricity", {"a": 0.3, "b": 0.1}),
    )
    packed = rig.packed()
    t = 0.001 * np.arange(40)
    q = np.array([[0.4], [q2]]) + np.array([[-0.5], [1.0]]) * speed * t
    y = q.copy()
    read_sensors(q, np.repeat(packed.p[:, None], t.size, axis=1), packed.codes, y)
    zeros = np.array([[0.2], [-0.003]])
    record = Record.from_arrays(t, (y + zeros).T, np.zeros(t.size), [1e-7] * 2)
    x = record.first_state(packed.p[:, None], packed.codes, packed.rows, zeros)[:, 0]
    assert x[:2] == pytest.approx(q[:, 0], abs=1e-9)
    assert x[2:4] == pytest.approx([-0.5 * speed, speed], abs=0.1)


def test_without_effects_of_the_encoders_the_first_state_is_what_they_read() -> None:
    packed = TABLE_3.packed()
    record = Record.from_log(loop_log(duration=3.0)[0])
    x = record.first_state(packed.p[:, None], packed.codes, packed.rows)[:, 0]
    assert x.tolist() == pytest.approx([*record.y[0], *record.velocity], abs=1e-9)


def test_the_online_filter_starts_from_a_log_with_a_command() -> None:
    """A free decay has no scale: whether it comes first or last does not matter to the start."""
    driven = loop_log(duration=6.0)[0]
    decay = replace(loop_log(duration=4.0, seed=1)[0], u=np.zeros(2001)[: len(loop_log(duration=4.0, seed=1)[0])])
    history = track([decay, driven])
    assert np.isfinite(history.theta).all()
    assert history.last[0] == pytest.approx(TABLE_3.theta[0], rel=0.3)


def test_a_short_fast_log_has_readings_that_are_read() -> None:
    """Shorter than the time over which the motion is measured."""
    t = 0.001 * np.arange(20)
    angles = np.column_stack([np.sin(t), np.cos(t)])
    assert informative(Record.from_arrays(t, angles, np.sin(t), np.full(2, 1e-8), np.full(2, 1.5e-3))).any()
