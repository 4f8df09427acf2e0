"""sin, cos, tanh, exp and log of the compiled core against the library."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from furuta_gym.plant.elementary import decay, exp, log, sincos, tanh


@pytest.fixture(scope="module")
def angles():
    rng = np.random.default_rng(3)
    quadrants = np.arange(-40, 41) * np.pi / 4
    near = (quadrants[:, None] + np.array([-1e-3, -1e-9, 0.0, 1e-9, 1e-3])).ravel()
    return np.concatenate([near, rng.uniform(-10, 10, 20000), rng.uniform(-1e4, 1e4, 20000)])


def test_sine_and_cosine_are_the_librarys(angles):
    ours = np.array([sincos(x) for x in angles])
    assert np.abs(ours[:, 0] - np.sin(angles)).max() < 4e-16
    assert np.abs(ours[:, 1] - np.cos(angles)).max() < 4e-16


def test_small_sine_keeps_relative_precision():
    """Near upright sin q2 ≈ q2 drives everything: an absolute error alone would not do."""
    for x in np.geomspace(1e-300, 1e-2, 200):
        np.testing.assert_allclose([sincos(x)[0], sincos(-x)[0]], [np.sin(x), -np.sin(x)], rtol=4e-16)


@given(st.floats(-1e6, 1e6))
def test_tanh_is_the_librarys(x):
    assert abs(tanh(x) - np.tanh(x)) < 2e-15
    assert tanh(-x) == -tanh(x)


def test_tanh_keeps_relative_precision_near_zero_and_saturates():
    for x in np.geomspace(1e-12, 1.0, 200):
        np.testing.assert_allclose(tanh(x), np.tanh(x), rtol=1e-14)
    assert tanh(0.0) == 0.0
    assert tanh(25.0) == tanh(1e9) == pytest.approx(1.0, abs=1e-15)
    assert tanh(np.inf) == pytest.approx(1.0, abs=1e-15)


def test_not_a_number_stays_one():
    assert np.isnan(tanh(np.nan))
    assert np.isnan(sincos(np.nan)).all()


@given(st.floats(-700.0, 700.0))
def test_exp_is_the_librarys(x):
    assert exp(x) == pytest.approx(np.exp(x), rel=5e-16)


@given(st.floats(1e-300, 1e300))
def test_log_is_the_librarys(x):
    assert abs(log(x) - np.log(x)) <= 2.0 * np.spacing(abs(np.log(x)))


def test_log_keeps_relative_precision_near_one():
    for x in np.geomspace(1e-12, 0.4, 200):
        np.testing.assert_allclose([log(1.0 + x), log(1.0 - x)], [np.log(1.0 + x), np.log(1.0 - x)], rtol=4e-16)
    assert log(1.0) == 0.0


def test_sine_of_a_long_log_is_the_librarys():
    """2π f t of an hour at 30 Hz is 7e5 rad."""
    for x in np.random.default_rng(1).uniform(-1e6, 1e6, 20000):
        assert abs(sincos(x)[0] - np.sin(x)) < 1e-15


def test_decay_vanishes_however_fast():
    assert decay(0.0) == 1.0
    assert decay(3.0) == pytest.approx(np.exp(-3.0), rel=1e-15)
    assert 0.0 <= decay(1e6) < 1e-300
    assert 0.0 <= decay(np.inf) < 1e-300
