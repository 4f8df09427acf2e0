"""Noise as a value: what its four packed numbers are, and that a fit cannot change the one it was given."""

from __future__ import annotations

import numpy as np
import pytest

from furuta_gym.plant import TABLE_3
from identification.kalman.coordinates import filled_noise, noise_coordinates
from identification.kalman.noise_model import NOISE_NAMES, Noise, RecordNoise
from identification.kalman.path import follow, refilter
from identification.kalman.record import Record
from tests.factories import TORQUE_NOISE, loop_log


def test_the_packed_numbers_are_those_of_the_coordinates_names() -> None:
    noise = Noise((1.0, 2.0), (3.0, 4.0))
    coordinates = noise_coordinates()
    assert [c.name for c in coordinates] == list(NOISE_NAMES)
    assert [noise.packed()[c.row] for c in coordinates] == [1.0, 2.0, 3.0, 4.0]
    z = np.log([5.0, 6.0, 7.0, 8.0])
    filled = filled_noise(coordinates, z, noise)
    np.testing.assert_allclose(filled.torque, [5.0, 6.0])
    np.testing.assert_allclose(filled.reading_factor, [7.0, 8.0])
    np.testing.assert_array_equal(Noise.unpacked(noise.packed()).packed(), noise.packed())


def test_a_log_turns_factors_into_variances_and_leaves_torques_alone() -> None:
    record = Record.from_log(loop_log(duration=2.0)[0])
    noise = Noise((1e-7, 1e-9), (1.0, 2.0)).louder(3.0)
    of_log = noise.on(record)
    np.testing.assert_allclose(of_log.torque, [3e-7, 3e-9])
    np.testing.assert_array_equal(of_log.variance, record.variance * [1.0, 2.0])
    np.testing.assert_array_equal(of_log.packed(), [*of_log.torque, *of_log.variance])


def test_nobody_changes_a_noise_that_was_given() -> None:
    numbers = np.array([1e-7, 1e-9])
    noise = Noise(numbers)
    numbers[0] = 1.0
    noise.packed()[0] = 1.0
    assert noise.torque[0] == 1e-7
    with pytest.raises(ValueError, match="read-only"):
        noise.torque[0] = 1.0


def test_other_shapes_are_refused() -> None:
    with pytest.raises(ValueError, match=r"torque must be two numbers.*\(3,\)"):
        Noise((1.0, 2.0, 3.0))
    with pytest.raises(ValueError, match=r"variance must be two numbers.*\(\)"):
        RecordNoise((1.0, 2.0), 3.0)


def test_filtering_again_leaves_the_path_as_it_was() -> None:
    record = Record.from_log(loop_log(duration=2.0)[0])
    walk = np.array(TORQUE_NOISE)
    path = follow(TABLE_3, record, RecordNoise(TORQUE_NOISE, record.variance), walk)
    assert path is not None
    before = [a.copy() for a in (*path.linearised, *path.assumed, *path.found)]
    again = refilter(
        path, path.noise.louder(10.0), 2.0 * walk, np.ones((len(record.t), 2)), np.ones((len(record.t), 2))
    )
    assert not np.array_equal(again.e, path.e)
    for kept, now in zip(before, (*path.linearised, *path.assumed, *path.found), strict=True):
        np.testing.assert_array_equal(kept, now)
