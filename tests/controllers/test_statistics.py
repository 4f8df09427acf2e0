"""Intervals against tables, and their coverage on known distributions."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controllers.comparison.statistics import IntervalEntry, interquartile_mean, success_rate, typical, worst
from furuta_gym.declared import checked


def test_wilson_interval_against_published_values():
    """Newcombe (1998), table I: 81 of 263, and 0 of 20."""
    one, none = success_rate([True] * 81 + [False] * 182), success_rate([False] * 20)
    assert (one.low, one.high) == pytest.approx((0.2553, 0.3662), abs=5e-5)
    assert (none.low, none.high) == pytest.approx((0.0, 0.1611), abs=5e-5)


def test_interquartile_mean_by_hand():
    assert interquartile_mean(np.array([9.0, 1.0, 2.0, 100.0])) == pytest.approx((2 + 9) / 2)
    # of five values the middle 2.5 count: half of a quarter is left of the second and of the fourth
    assert interquartile_mean(np.array([0.0, 1.0, 2.0, 3.0, 1e6])) == pytest.approx((0.75 * 1 + 2 + 0.75 * 3) / 2.5)


@given(st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=30))
def test_typical_value_lies_in_its_interval_and_in_the_sample(values):
    x = typical(values, resamples=200)
    slack = 1e-9 * (1 + max(abs(v) for v in values))
    assert min(values) - slack <= x.low <= x.high <= max(values) + slack
    assert x.n == len(values)


def test_bootstrap_interval_covers():
    rng = np.random.default_rng(5)
    inside = sum((x := typical(rng.standard_normal(60), resamples=400)).low <= 0 <= x.high for _ in range(1000))
    assert 925 <= inside <= 970  # 950 ± 7 of exact intervals; those of 90 % and 99 % would be out


def test_no_trials_give_no_number():
    for x in (typical([]), success_rate([])):
        assert np.isnan(x.value)
        assert x.to_dict()["value"] is None
        assert np.isnan(checked(x.to_dict(), IntervalEntry).interval().low)


@pytest.mark.parametrize("mean", [typical, worst])
def test_one_trial_has_a_mean_and_no_interval(mean):
    x = mean([3.0])
    assert (x.value, x.n) == (3.0, 1)
    assert np.isnan([x.low, x.high]).all()
    assert str(x) == "3"
    assert x.to_dict() == {"value": 3.0, "low": None, "high": None, "n": 1}


def test_the_worst_are_the_largest():
    values = np.arange(1.0, 101.0)
    found = worst(np.random.default_rng(0).permutation(values))
    assert found.value == pytest.approx(98.0)  # the mean of 96 … 100
    assert found.low < found.value < found.high <= 100.0
    assert worst([3.0, 1.0]).value == 3.0
    assert worst([]).n == 0


def test_the_worst_of_few_have_no_interval():
    few = worst(np.arange(1.0, 100.0))
    assert few.value == pytest.approx(97.0)  # the mean of 95 … 99
    assert np.isnan([few.low, few.high]).all()
    assert few.to_dict() == {"value": few.value, "low": None, "high": None, "n": 99}


def test_the_interval_of_the_worst_is_rough():
    """Of 200 normal values it covers less than 95 %, and more than its docstring's 80 %."""
    rng, mean = np.random.default_rng(3), 2.0627  # of the largest 5 % of a normal distribution
    inside = sum((x := worst(rng.standard_normal(200), resamples=400)).low <= mean <= x.high for _ in range(400))
    assert 0.80 < inside / 400 < 0.95
