"""Section 2.2 against hand-written formulas, and the sensor estimates against known sensors."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from identification.least_squares.signals import WC, central_difference, cutoff_frequency, low_pass, zero_phase


def windowed_sinc(order: int, wc: float) -> np.ndarray:
    """The textbook design: ideal low-pass times a four-term Nuttall window, scaled to gain 1 at zero frequency."""
    k = np.arange(order + 1)
    phase = 2 * np.pi * k / order
    window = 0.3635819 - 0.4891775 * np.cos(phase) + 0.1365995 * np.cos(2 * phase) - 0.0106411 * np.cos(3 * phase)
    taps = wc * np.sinc(wc * (k - order / 2)) * window
    return taps / taps.sum()


@pytest.mark.parametrize("wc", [WC, 0.03, 0.2, 0.6])
def test_filter_is_the_textbook_design_with_31_taps(wc):
    taps = low_pass(wc)
    assert len(taps) == 31
    np.testing.assert_allclose(taps, windowed_sinc(30, wc), atol=1e-12)
    assert taps.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(taps, taps[::-1], atol=1e-15)


@pytest.mark.parametrize("wc", [0.0, 1.0, -0.1, np.nan])
def test_filter_rejects_cutoffs_that_are_not_fractions(wc):
    with pytest.raises(ValueError, match="fraction of the Nyquist frequency"):
        low_pass(wc)


def test_cutoff_is_where_a_sine_comes_out_half_as_large():
    T, taps = 0.001, low_pass()
    f = cutoff_frequency(taps, T)
    t = np.arange(4000) * T
    out = zero_phase(np.sin(2 * np.pi * f * t), taps)
    assert np.ptp(out[1000:3000]) == pytest.approx(1.0, abs=0.01)
    assert cutoff_frequency(taps, 2 * T) == pytest.approx(f / 2)


def test_filter_does_not_delay():
    t, inner = np.arange(3000) * 0.002, slice(300, -300)
    for f in (0.7, 5.0, 15.0):
        out = zero_phase(np.sin(2 * np.pi * f * t), low_pass())[inner]
        basis = np.column_stack([np.sin(2 * np.pi * f * t), np.cos(2 * np.pi * f * t)])[inner]
        in_phase, quadrature = np.linalg.lstsq(basis, out, rcond=None)[0]
        assert in_phase > 0.5
        assert abs(quadrature) < 1e-12
    pulse = np.zeros(401)
    pulse[200] = 1.0
    response = zero_phase(pulse, low_pass())
    np.testing.assert_allclose(response, response[::-1], atol=1e-15)


def test_filter_keeps_straight_lines_to_their_ends():
    line = 3.0 - 0.2 * np.arange(200.0)
    np.testing.assert_allclose(zero_phase(line, low_pass()), line, atol=1e-10)


def test_filter_says_how_long_a_record_must_be():
    with pytest.raises(ValueError, match="more than 90"):
        zero_phase(np.zeros(90), low_pass())
    assert zero_phase(np.ones(91), low_pass()) == pytest.approx(np.ones(91))


@given(st.tuples(*[st.floats(-10, 10)] * 3), st.floats(1e-4, 0.1))
def test_central_difference_is_exact_on_parabolas(coefficients, T):
    t = T * np.arange(20)
    a, b, c = coefficients
    v = central_difference(a + b * t + c * t**2, T)
    np.testing.assert_allclose(v, b + 2 * c * t, atol=1e-9 / T)


def test_central_difference_converges_with_the_square_of_the_step():
    errors = []
    for n in (100, 200, 400):
        t = np.linspace(0, 1, n + 1)
        q = np.column_stack([np.sin(6 * t), np.cos(5 * t)])
        v = np.column_stack([6 * np.cos(6 * t), -5 * np.sin(5 * t)])
        errors.append(np.abs(central_difference(q, 1 / n) - v).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.1)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2, abs=0.1)
