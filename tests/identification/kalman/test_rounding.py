"""The functions behind a rounded reading, against SciPy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import special, stats

from identification.kalman.rounding import counted, erfcx


def test_erfcx_is_scipys() -> None:
    for x in np.concatenate([np.linspace(0.0, 10.0, 2001), np.logspace(1, 8, 50)]):
        assert erfcx(x) == pytest.approx(special.erfcx(x), rel=2e-15)


@pytest.mark.parametrize("d", [-9.0, -3.1, -0.4, 0.0, 0.2, 1.7, 4.4, 12.0])
@pytest.mark.parametrize("step", [0.3, 1.0, 5.0])
def test_a_cell_leaves_the_moments_of_a_truncated_normal(d: float, step: float) -> None:
    """A prior N(0, v) cut to the cell; the equivalent Gaussian reading leaves the same mean and variance."""
    s = 0.02
    v, d, step = s * s, d * s, step * s
    e, S, cost = counted(d, v, step)
    cut = stats.truncnorm((d - 0.5 * step) / s, (d + 0.5 * step) / s, scale=s)
    assert v / S * e == pytest.approx(cut.mean(), rel=1e-6, abs=1e-12)
    assert v - v * v / S == pytest.approx(cut.var(), rel=1e-4)
    a, b = (abs(d) - 0.5 * step) / s, (abs(d) + 0.5 * step) / s
    log_inside = special.log_ndtr(-a) + np.log1p(-np.exp(special.log_ndtr(-b) - special.log_ndtr(-a)))
    assert cost == pytest.approx(np.log(step) - log_inside - 0.5 * np.log(2.0 * np.pi), rel=1e-9)
