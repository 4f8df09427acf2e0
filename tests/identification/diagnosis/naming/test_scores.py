"""The size of a score in nats, and the starts that scores suggest."""

from __future__ import annotations

import numpy as np
import pytest

from identification.diagnosis.naming.scores import _best_weights


def test_a_gain_is_half_of_what_least_squares_explains() -> None:
    rng = np.random.default_rng(0)
    D, y = rng.standard_normal((50, 3)) * [1.0, 1e-3, 1e2], rng.standard_normal(50)
    gain, weights = _best_weights(D.T @ D, D.T @ y)
    best = np.linalg.lstsq(D, y)[0]
    assert weights == pytest.approx(best)
    assert gain == pytest.approx(0.5 * (y @ y - np.sum((y - D @ best) ** 2)))
