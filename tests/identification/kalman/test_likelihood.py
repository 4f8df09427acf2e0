"""The likelihood of innovations, against the density of a normal distribution."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from identification.kalman.likelihood import innovation_cost, sample_costs


def test_costs_are_those_of_the_normal_density() -> None:
    rng = np.random.default_rng(4)
    e = rng.normal(size=(7, 2))
    roots = rng.normal(size=(7, 2, 2))
    S = roots @ roots.transpose(0, 2, 1) + 0.1 * np.eye(2)
    packed = np.column_stack([S[:, 0, 0], S[:, 0, 1], S[:, 1, 1]])
    expected = [-multivariate_normal(cov=one).logpdf(x) - np.log(2.0 * np.pi) for one, x in zip(S, e, strict=True)]
    assert sample_costs(e, packed) == pytest.approx(expected, rel=1e-9)
    assert innovation_cost(e, packed) == pytest.approx(sum(expected), rel=1e-9)


@pytest.mark.parametrize("lost", [(1.0, 2.0, 1.0), (0.0, 0.0, 0.0), (np.inf, np.inf, np.inf), (np.nan, 0.0, 1.0)])
def test_a_filter_that_lost_its_log_costs_infinitely_much_without_a_warning(lost: tuple[float, ...]) -> None:
    S = np.array([(1.0, 0.0, 1.0), lost])
    assert list(sample_costs(np.zeros((2, 2)), S)) == [0.0, np.inf]
    assert innovation_cost(np.zeros((2, 2)), S) == np.inf
