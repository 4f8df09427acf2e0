"""The fit of noise intensities on a linearised log: its bank of filters, and its derivatives."""

from dataclasses import replace

import numpy as np
import pytest

from furuta_gym.plant import TABLE_3
from identification.kalman.likelihood import innovation_cost
from identification.kalman.noise import _Problem
from identification.kalman.noise_model import RecordNoise
from identification.kalman.path import follow, refilter
from identification.kalman.record import Record
from tests.factories import TORQUE_NOISE, loop_log


@pytest.fixture(params=[False, True], ids=["fixed", "walk"])
def problem(request) -> _Problem:
    """On a log whose every other sample or fewer is read, and at times not both angles."""
    record = Record.from_log(loop_log(T=0.001, counts=1024, duration=4.0)[0])
    noise = RecordNoise(10.0 * np.asarray(TORQUE_NOISE), record.variance)
    path = follow(TABLE_3, record, noise, noise.torque if request.param else None)
    assert path is not None
    assert not path.used.all()
    used = path.used.copy()
    used[1000:1500, 0] = used[1400:1800, 1] = False  # one angle is not read, then neither, then not the other
    return _Problem(replace(path, used=used))


def test_filters_side_by_side_are_the_single_ones(problem):
    z = problem.start()
    points = z + np.vstack([np.zeros_like(z), np.diag(np.full(len(z), 0.7))])
    e, S = problem._bank(points)
    for i, point in enumerate(points):
        noise, walk = problem.unpack(point)
        one = refilter(problem.path, noise, walk)
        np.testing.assert_allclose(e[:, :, i], one.e, rtol=1e-7, atol=1e-14)
        np.testing.assert_allclose(S[:, :, i], one.S, rtol=1e-7)


def test_value_and_gradient_are_those_of_the_likelihood(problem):
    z = problem.start()
    value, gradient, information = problem.expand(z)
    one = refilter(problem.path, *problem.unpack(z))
    assert value - problem._prior(z)[0] == pytest.approx(innovation_cost(one.e, one.S), rel=1e-9)
    h = 1e-4
    for i in range(len(z)):
        step = np.eye(len(z))[i] * h
        central = (problem.expand(z + step)[0] - problem.expand(z - step)[0]) / (2 * h)
        assert gradient[i] == pytest.approx(central, abs=2e-3 * max(1.0, information[i, i]))
