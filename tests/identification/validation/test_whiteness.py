"""What tests of the innovations say of noise that is white, and of noise that is not."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import kstest

from identification.kalman.whiteness import Innovations, Whitened, innovations

N, T = 600, 0.01


def seen_in(w: np.ndarray, u: np.ndarray) -> Innovations:
    return innovations(Whitened(np.arange(N) * T, w, u))


def test_of_white_noise_the_probabilities_are_uniform_and_19_of_20_correlations_in_the_band() -> None:
    rng = np.random.default_rng(0)
    found = [seen_in(rng.standard_normal((N, 2)) * [2.0, 0.3], rng.standard_normal(N)) for _ in range(200)]
    for name in ("p_white", "p_command"):
        assert kstest(np.ravel([getattr(f, name) for f in found]), "uniform").pvalue > 0.01
    for name in ("correlation", "command_correlation"):
        inside = np.abs([getattr(f, name) for f in found]) < found[0].band
        assert inside.mean() == pytest.approx(0.95, abs=0.01)


def test_noise_that_goes_on_is_not_white() -> None:
    rng = np.random.default_rng(1)
    w, e = np.zeros((N, 2)), rng.standard_normal((N, 2))
    for i in range(1, N):
        w[i] = [0.3, 0.0] * w[i - 1] + e[i]
    found = seen_in(w, rng.standard_normal(N))
    assert found.p_white[0] < 1e-4 < found.p_white[1]
    assert found.correlation[0, 0] == pytest.approx(0.3, abs=0.1)


def test_an_answer_to_the_command_is_seen_at_its_lag_and_on_its_axis() -> None:
    rng = np.random.default_rng(2)
    u, w = rng.standard_normal(N), rng.standard_normal((N, 2))
    w[3:, 0] += 0.3 * np.diff(u, prepend=u[0])[:-3]
    found = seen_in(w, u)
    assert found.p_command[0] < 1e-6 < found.p_command[1]
    assert np.abs(found.command_correlation[:, 0]).argmax() == 2
