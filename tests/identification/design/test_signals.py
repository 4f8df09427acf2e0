"""d(t) of (24) against its printed intervals, and what each signal promises."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from identification.design.signals import (
    EXCITATIONS,
    Chirp,
    Multisine,
    Prbs,
    SquareWave,
    excitation,
    paper_signal,
)


def printed(t: float) -> float:
    """(24) typed in: the first interval that holds t, after whole periods are taken off."""

    def wave(t, amplitude, low, period):
        if t > period:
            t -= period * (np.ceil(t / period) - 1)
        return -amplitude if 0 <= t <= low else amplitude

    return wave(t, 1.0, 1.0, 2.0) + wave(t, 0.5, 0.25, 0.5) + wave(t, 0.25, 0.1667, 0.3333)


@given(st.floats(0, 100, exclude_min=True))
def test_paper_excitation_is_the_printed_one(t):
    near = min(abs(t / p - round(t / p)) for p in (1.0, 0.25, 0.3333)), abs((t - 0.1667) % 0.3333)
    if min(near) > 1e-6:  # at the switching times rounding decides; they have a test of their own
        assert paper_signal()(t) == printed(t)


@pytest.mark.parametrize(
    ("t", "d1"), [(0.0, -1), (1.0, -1), (1.0001, 1), (2.0, 1), (2.0001, -1), (3.0, -1), (3.0001, 1)]
)
def test_switching_times_belong_to_the_interval_before(t, d1):
    assert paper_signal().parts[0](t) == d1


def test_printed_times_of_d2_and_d3():
    d2, d3 = paper_signal().parts[1:]
    assert [d2(t) for t in (0.0, 0.25, 0.2501, 0.5, 0.5001)] == [-0.5, -0.5, 0.5, 0.5, -0.5]
    assert [d3(t) for t in (0.0, 0.1667, 0.16671, 0.3333, 0.33331)] == [-0.25, -0.25, 0.25, 0.25, -0.25]


@pytest.mark.parametrize("T", [0.001, 0.002, 0.005])
def test_rounding_of_sample_times_does_not_move_an_edge(T):
    k = np.arange(1, round(20 / T))
    exact = np.where((k - 1) // round(1 / T) % 2 == 0, -1.0, 1.0)  # from whole numbers alone
    np.testing.assert_array_equal(paper_signal().parts[0](k * T), exact)


def test_phase_shifts_by_fractions_of_a_period():
    t = np.linspace(0.001, 10, 777)
    np.testing.assert_array_equal(paper_signal((0.25, 0, 0))(t) - paper_signal()(t), d1(t + 0.5) - d1(t))
    np.testing.assert_array_equal(paper_signal((1, 2, 3))(t), paper_signal()(t))


def d1(t):
    return SquareWave(1.0, 2.0)(t)


@pytest.mark.parametrize("name", EXCITATIONS)
def test_every_signal_keeps_its_amplitude_and_is_one_function_of_time(name):
    signal = excitation(name, scale=0.7, duration=20.0, seed=3)
    t = np.arange(0, 20, 0.002)
    d = signal(t)
    peak = 1.75 * 0.7 if name == "paper" else 0.7
    assert d.shape == t.shape
    assert 0.9 * peak <= np.abs(d).max() <= peak * 1.01
    assert abs(d.mean()) < 0.1 * peak
    for k in (0, 1, 777, 9999):
        assert signal(t[k]) == pytest.approx(d[k])
        assert np.ndim(signal(float(t[k]))) == 0
    np.testing.assert_allclose(signal(t[::5]), d[::5])
    np.testing.assert_array_equal(excitation(name, scale=0.7, duration=20.0, seed=3)(t), d)


@pytest.mark.parametrize("name", ["paper", "prbs", "multisine"])
def test_seeds_differ(name):
    t = np.arange(0, 20, 0.002)
    assert not np.array_equal(excitation(name, seed=1)(t), excitation(name, seed=2)(t))


@pytest.mark.parametrize("logarithmic", [False, True])
def test_chirp_has_the_frequencies_it_promises(logarithmic):
    chirp = Chirp(1.5, 10.0, 1.0, 10.0, logarithmic)
    t = np.linspace(0, 12, 120_001)
    cycles = np.unwrap(np.angle(analytic(chirp(t) / 1.5))) / (2 * np.pi)
    frequency = np.abs(np.gradient(cycles, t))
    middle = np.sqrt(10.0) if logarithmic else 5.5
    for when, expected in ((0.5, None), (5.0, middle), (11.5, 1.0)):
        if expected:
            assert np.median(frequency[np.abs(t - when) < 0.2]) == pytest.approx(expected, rel=0.05)


def analytic(x):
    from scipy.signal import hilbert

    return hilbert(x)


def test_prbs_is_a_full_balanced_sequence_held_for_its_time():
    prbs = Prbs(2.0, 0.1, order=6, seed=4)
    values = prbs(np.arange(63) * 0.1 + 0.05)
    assert set(values) == {-2.0, 2.0}
    assert abs(values.sum()) == 2.0  # one more of one sign in a maximum-length sequence
    np.testing.assert_array_equal(prbs(np.arange(63) * 0.1), values)  # edges at whole multiples, despite rounding
    np.testing.assert_array_equal(prbs(np.arange(63, 126) * 0.1), values)
    spectrum = np.abs(np.fft.fft(values / 2.0)[1:])
    np.testing.assert_allclose(spectrum, spectrum[0], rtol=1e-9)  # flat but for its mean


def test_multisine_has_only_its_lines_and_a_low_crest():
    multisine = Multisine.band(1.0, 0.5, 5.0, period=4.0, seed=1)
    assert multisine.frequencies[0] == 0.5
    assert multisine.frequencies[-1] == 5.0
    t = np.arange(0, 4, 0.005)
    d = multisine(t)
    spectrum = np.abs(np.fft.rfft(d)) / len(t) * 2
    lines = np.round(np.array(multisine.frequencies) * 4).astype(int)
    np.testing.assert_allclose(spectrum[lines], spectrum[lines[0]], rtol=1e-9)
    assert np.delete(spectrum, lines).max() < 1e-12
    assert np.abs(d).max() / np.std(d) < 2.6


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: excitation("sawtooth"), "paper, square, chirp, prbs, multisine"),
        (lambda: excitation("prbs", duration=0), "positive"),
        (lambda: SquareWave(1.0, 0.0), "low < period"),
        (lambda: Chirp(1.0, 0.0, 5.0, 10.0, logarithmic=True), "above 0 Hz"),
        (lambda: Chirp(1.0, 1.0, 5.0, 0.0), "positive"),
        (lambda: Prbs(1.0, -0.1), "hold > 0"),
        (lambda: Multisine(1.0, ()), "at least one"),
    ],
)
def test_impossible_signals_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()
