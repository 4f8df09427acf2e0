"""Which readings a filter takes: all of an angle that moves, and of one that rests so few that their errors differ."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from identification.discrepancy.basis import Columns
from identification.discrepancy.response import Normal, answers
from identification.kalman.likelihood import whiten
from identification.kalman.noise import fit_noise
from identification.kalman.noise_model import RecordNoise
from identification.kalman.path import FilterPath, follow, refilter
from identification.kalman.record import Record
from identification.kalman.taken import FEWEST, informative, taken
from tests.factories import TORQUE_NOISE, loop_log
from tests.identification.validation.test_resting import STICKY, pulses

COUNT = 2 * np.pi / 2048
T = 0.004


def record(q1: np.ndarray, q2: np.ndarray) -> Record:
    """Readings rounded to counts."""
    y = COUNT * np.round(np.column_stack([q1, q2]) / COUNT)
    t = T * np.arange(len(y))
    return Record.from_arrays(t, y, np.zeros(len(t)), np.full(2, COUNT**2 / 12), np.full(2, COUNT))


def moving(n: int) -> np.ndarray:
    return 2.0 * T * np.arange(n)


def test_of_angles_that_move_nothing_more_is_left_out() -> None:
    both = record(moving(2000), 3.0 * moving(2000))
    np.testing.assert_array_equal(taken(both), np.repeat(informative(both)[:, None], 2, axis=1))


def test_a_rest_is_read_ten_times_a_second_and_not_where_it_begins_or_ends() -> None:
    q1 = moving(2000)
    q1[500:1000] = q1[500]
    found = taken(log := record(q1, 3.0 * moving(2000)))
    rest = found[500:1000, 0]
    assert rest.sum() == pytest.approx(20, abs=1)
    assert not rest[:8].any()
    assert not rest[-8:].any()
    np.testing.assert_array_equal(found[:, 1], informative(log))
    np.testing.assert_array_equal(found[:450, 0], informative(log)[:450])


def test_readings_without_counts_are_all_taken() -> None:
    still = record(np.zeros(500), np.zeros(500))
    fine = replace(still, quantum=np.zeros(2))
    assert taken(fine)[:, 0].sum() == informative(fine).sum()


@given(st.integers(0, 2**32 - 1), st.integers(20, 400))
def test_there_are_always_enough_to_test(seed: int, n: int) -> None:
    """However the angles rest and go on."""
    rng = np.random.default_rng(seed)
    rates = np.repeat(rng.choice([0.0, 0.01, 3.0], (40, 2)), 10, axis=0)[:n]
    log = record(*np.cumsum(T * rates, axis=0).T)
    found = taken(log)
    assert found.any(axis=1).sum() >= min(FEWEST, informative(log).sum())


@pytest.fixture(scope="module")
def partly() -> FilterPath:
    """A path on which one angle, the other or neither is read for a while."""
    log, plant = loop_log(duration=2.0)
    whole = Record.from_log(log)
    noise = RecordNoise(10.0 * np.asarray(TORQUE_NOISE), whole.variance)
    path = follow(plant, whole, noise)
    assert path is not None
    used = path.used.copy()
    used[100:300, 0] = False
    used[250:400, 1] = False
    return refilter(replace(path, used=used), noise)


def test_an_angle_that_is_not_read_is_a_filter_of_the_other_alone(partly: FilterPath) -> None:
    """Against the textbook's update with the rows that are read."""
    path, R = partly, np.diag(partly.noise.variance)
    for k in (50, 150, 280, 350):
        rows = path.used[k]
        before = path.covariance[k].copy()
        if rows.any():
            H = path.reading[k][rows]
            information = np.linalg.inv(before) - H.T @ np.linalg.inv(R[np.ix_(rows, rows)]) @ H
            prior = np.linalg.inv(information)
            gain = prior @ H.T @ np.linalg.inv(H @ prior @ H.T + R[np.ix_(rows, rows)])
            np.testing.assert_allclose(path.gain[k][:, rows], gain, rtol=1e-4, atol=1e-9 * np.abs(gain).max())
        assert not path.gain[k][:, ~rows].any()
        assert not path.e[k][~rows].any()


def test_answers_are_what_a_torque_changes_where_readings_are_left_out(partly: FilterPath) -> None:
    torque = 1e-6 * np.random.default_rng(1).standard_normal((len(partly.e), 2, 1))
    pushed = refilter(partly, partly.noise, torque=torque[:, :, 0])
    found = answers(partly, Columns(torque=torque)).reshape(-1, 2)
    np.testing.assert_allclose(whiten(pushed.e - partly.e, partly.S), found, atol=1e-6 * np.abs(found).max())
    assert not found[~partly.used].any()


def test_families_side_by_side_answer_as_each_does_alone(partly: FilterPath) -> None:
    """In their order, whatever they stand for: torques, errors of readings, or one kind after the other."""
    rng, shape = np.random.default_rng(3), (len(partly.record.t), 2)
    families = [
        Columns(torque=rng.normal(size=(*shape, 1))),
        Columns(torque=rng.normal(size=(*shape, 3))),
        Columns(misreading=rng.normal(size=(*shape, 2))),
        Columns(torque=rng.normal(size=(*shape, 2))),
    ]
    alone = Normal.of_columns(partly, [answers(partly, family) for family in families])
    together = Normal.of(partly, families)
    np.testing.assert_allclose(together.gram, alone.gram, rtol=1e-12)
    np.testing.assert_allclose(together.right, alone.right, rtol=1e-9)


def test_the_noise_of_a_rig_that_rests_is_not_its_rounding() -> None:
    """Rounding alone: the torque noise of a right plant is next to nothing, though the arm stands still at times."""
    fitted = fit_noise(STICKY, Record.from_log(pulses(0, 1024)))
    assert fitted.path.used[:, 0].mean() < 0.9
    assert np.sqrt(fitted.noise.torque[0] / 0.1) < 0.01 * STICKY.theta[7]
