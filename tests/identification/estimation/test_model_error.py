"""Error bars that allow for what a model lacks: nothing where it is right, enough where it is not."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from identification.estimation import model_error as room
from identification.estimation.estimate import Estimate
from identification.estimation.identify import identify
from identification.estimation.model_error import likeliest_variances, model_error, second_moment
from tests.factories import hanging_log, loop_log, noisy_log


def regression(seed: int, size: dict[str, float], rows: int = 4000, columns: int = 30):
    """Normal equations of white noise plus columns whose coefficients have these deviations, by group."""
    rng = np.random.default_rng(seed)
    groups = [group for group in size for _ in range(columns)]
    D = rng.standard_normal((rows, len(groups)))
    D /= np.linalg.norm(D, axis=0)
    w = np.array([size[g] for g in groups]) * rng.standard_normal(len(groups))
    y = D @ w + rng.standard_normal(rows)
    return D.T @ D, D.T @ y, groups


@pytest.mark.parametrize("size", [3.0, 10.0])
def test_the_variance_of_a_group_is_found_and_the_other_stays_small(size: float) -> None:
    found = [likeliest_variances(*regression(seed, {"arm": size, "sensor": 0.0})) for seed in range(20)]
    arm, sensor = (np.array([v[i] for v in found]) for i in (0, -1))
    assert np.median(arm) == pytest.approx(size**2, rel=0.5)  # of 30 coefficients, on a grid of half decades
    assert np.median(sensor) <= 0.1
    assert all(len(set(v[:30])) == 1 for v in found)


def test_noise_alone_has_no_variance_more_often_than_not() -> None:
    found = np.array([likeliest_variances(*regression(seed, {"arm": 0.0})).max() for seed in range(60)])
    assert np.mean(found == 0.0) > 0.5
    assert found.max() <= 1.0  # the noise has that much itself


@pytest.fixture(scope="module")
def lacking() -> Estimate:
    """Model (5) on a log whose arm is held by a weak spring."""
    return identify(loop_log("arm_spring", 0.3)[0])


def test_a_right_model_keeps_its_error_bars() -> None:
    widened = []
    for seed in range(4):
        estimate = identify(noisy_log(seed, duration=5.0))
        widened.append(np.median(estimate.std / estimate.std_if_right))
    assert min(widened) >= 1.0
    assert np.median(widened) < 1.3


def test_a_lacking_models_intervals_hold_most_of_what_they_missed(lacking: Estimate) -> None:
    """Three logs, θ by model (5): with the bars of a right model two thirds of θ lie outside."""
    stated, right = [], []
    for name, size in (("arm_spring", 0.3), ("input_dead_zone", 1.0), ("input_delay", 0.3)):
        log, plant = loop_log(name, size)
        estimate = lacking if name == "arm_spring" else identify(log)
        error = np.abs(estimate.values[:9] - plant.theta)
        stated += list(error < 1.96 * estimate.std[:9])
        right += list(error < 1.96 * estimate.std_if_right[:9])
    assert np.mean(right) < 0.5
    assert np.mean(stated) > 0.7
    assert "error bars allow for what this model lacks" in str(lacking)


def test_how_much_wider_has_one_decimal_place(lacking: Estimate) -> None:
    """Where few bars are wider the median is 1, which reads as a number that was measured."""
    added = np.zeros_like(lacking.covariance)
    added[0, 0] = 0.75 * lacking.covariance[0, 0]
    told = str(replace(lacking, model_error=added))
    assert "in the median 1.0 times those of a right model, at most 2.0 times (theta1)" in told


def test_the_second_moment_is_that_of_the_coefficients() -> None:
    """Drawn from the prior, the mean of E[w wᵀ] over many data is the prior's own covariance."""
    found = []
    for seed in range(200):
        gram, right, groups = regression(seed, {"arm": 3.0, "sensor": 0.5}, rows=200, columns=4)
        found.append(second_moment(gram, right, np.where(np.array(groups) == "arm", 9.0, 0.25)))
    assert np.diag(np.mean(found, axis=0)) == pytest.approx([9.0] * 4 + [0.25] * 4, rel=0.25)


def test_the_covariance_is_the_sum_of_its_parts_and_stays_one(lacking: Estimate) -> None:
    assert lacking.model_error is not None
    plain = identify(loop_log("arm_spring", 0.3)[0], model_error=False)
    assert plain.model_error is None
    assert lacking.covariance - lacking.model_error == pytest.approx(plain.covariance, rel=1e-9)
    assert plain.std == pytest.approx(lacking.std_if_right)
    assert np.linalg.eigvalsh(lacking.model_error / np.outer(lacking.std, lacking.std)).min() > -1e-9
    assert lacking.plant.covariance is not None
    assert np.sqrt(np.diag(lacking.plant.covariance.matrix)) == pytest.approx(lacking.std)


def test_a_limit_that_holds_is_no_knowledge_of_what_the_model_lacks() -> None:
    log = loop_log("input_delay", 0.3)[0]
    held, free = identify(log, physical=True), identify(log)
    assert held.log_likelihood < free.log_likelihood - 1.0  # the limit binds
    apart = np.zeros(len(held.names))
    apart[[1, 3]] = -1.0, 1.0  # θ4 − θ2, which is not negative for a rigid body
    of_it = [math.sqrt(apart @ e.model_error @ apart) for e in (held, free) if e.model_error is not None]
    assert of_it[0] > 0.3 * of_it[1]


def test_what_the_model_lacks_is_no_parameter_identified(lacking: Estimate) -> None:
    assert lacking.model_error is not None
    wide = 900.0 * lacking.model_error  # thirty times the deviation
    worse = replace(lacking, covariance=lacking.covariance + wide - lacking.model_error, model_error=wide)
    names = {n for n, v, s in zip(worse.names, worse.values, worse.std, strict=True) if s > 0.3 * abs(v)}
    assert "theta1" in worse.uncertain
    assert set(worse.uncertain) <= names
    assert "all parameters identified" not in worse.verdict
    assert "uncertain, as this model lacks something" in worse.verdict
    assert not replace(worse, covariance=worse.covariance - wide, model_error=0.0 * wide).uncertain


def test_a_long_log_is_looked_at_in_part(lacking: Estimate, monkeypatch: pytest.MonkeyPatch) -> None:
    assert lacking.problem is not None
    assert lacking.optimum is not None
    whole = np.sqrt(np.diag(model_error(lacking.problem, lacking.optimum.z)))
    monkeypatch.setattr(room, "ENOUGH", len(lacking.problem.records[0].t) // 2)
    part = np.sqrt(np.diag(model_error(lacking.problem, lacking.optimum.z)))
    seen = whole > 0
    assert np.all((part > 0) == seen)
    assert np.median(np.abs(np.log(part[seen] / whole[seen]))) < math.log(2.0)


def test_several_logs_are_looked_at_together() -> None:
    spring = loop_log("arm_spring", 0.3)[0]
    both = identify([spring, hanging_log()])
    assert both.model_error is not None
    assert np.all(both.std >= both.std_if_right)
    assert np.max(both.std / both.std_if_right) > 1.2


def test_methods_without_a_likelihood_are_left_alone() -> None:
    estimate = identify(noisy_log(0), method="filtered-ls")
    assert estimate.model_error is None
    assert estimate.std == pytest.approx(estimate.std_if_right)


def test_a_profile_does_not_start_from_the_widened_bar(lacking: Estimate) -> None:
    """Its steps are those of the likelihood, or its first point would lie far beyond the interval's end."""
    profile = lacking.profile("theta1")
    low, high = profile.interval
    half = 0.5 * (high - low)
    assert lacking.classical is not None
    assert half == pytest.approx(1.96 * math.sqrt(lacking.classical[0, 0]), rel=0.3)
    assert half < 0.5 * 1.96 * lacking.std[0]
