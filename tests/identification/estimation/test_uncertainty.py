"""Error bars whose formula no fit would show to be wrong: the sandwich, and the interval of the closed gap."""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
import pytest
from scipy.signal import lfilter

from experiments.bench import HiddenEffect, Rig
from furuta_gym.plant import Plant
from identification.estimation.estimate import Estimate
from identification.estimation.identify import identify
from identification.estimation.optimise import Expansion, minimise
from identification.estimation.prediction_error import PredictionError
from identification.estimation.uncertainty import (
    Profile,
    _crossing,
    fit_covariance,
    inverse_information,
    recommended,
)
from identification.validation.closed_fraction import closed_fraction
from identification.validation.gap import Gap
from tests.factories import bench_log, loop_log

T, SAMPLES = 0.01, 6000


@dataclass
class _Record:
    t: np.ndarray

    @property
    def duration(self) -> float:
        return float(self.t[-1] - self.t[0])


@dataclass
class _Problem:
    records: list[_Record]


def covariances(scores: list[np.ndarray]):
    """Of a fit whose log-likelihood curves by one per sample, so that its error is the mean of the scores."""
    problem = _Problem([_Record(T * np.arange(len(s))) for s in scores])
    information = np.eye(2) * sum(map(len, scores))
    expansion = Expansion(0.0, np.zeros(2), information, scores)
    return fit_covariance(cast(PredictionError, problem), expansion)


@pytest.mark.parametrize(("memory", "logs"), [(0.0, 1), (0.8, 1), (0.8, 3)])
def test_the_sandwich_is_the_scatter_of_the_estimates(memory, logs):
    rng = np.random.default_rng(4)
    errors, sandwich, classical = [], [], []
    for _ in range(300):
        white = rng.standard_normal((SAMPLES, 2)) @ np.array([[1.0, 0.5], [0.0, 1.0]])
        scores = lfilter([1.0], [1.0, -memory], white, axis=0)
        found = covariances(np.array_split(scores, logs))
        errors.append(scores.mean(axis=0))
        sandwich.append(found.sandwich)
        classical.append(found.classical)
    scatter = np.cov(np.array(errors).T)
    assert np.mean(sandwich, axis=0) == pytest.approx(scatter, rel=0.25)
    assert np.array(classical)[:, [0, 1], [0, 1]] == pytest.approx(1.0 / SAMPLES)
    wider = recommended(classical[0], np.mean(sandwich, axis=0))
    assert np.diag(wider) == pytest.approx(np.maximum(np.diag(classical[0]), np.diag(scatter)), rel=0.25)


def gap(errors: np.ndarray, floor: float = 1.0, per_second: int = 10) -> Gap:
    n = len(errors)
    rms = np.sqrt(np.mean(errors**2, axis=0))
    nothing = np.zeros(2)
    return Gap(
        horizon=0.5,
        rms=rms,
        floor=np.full(2, floor),
        reading_floor=nothing,
        fit_percent=nothing,
        whiteness=0.0,
        counts=nothing,
        repeats=False,
        curve=np.zeros((0, 5)),
        tests=(),
        errors=errors,
        floors=np.full((n, 2), floor**2),
        reading_floors=np.zeros((n, 2)),
        times=(np.arange(n) + 0.5) / per_second,
        log=np.zeros(n, dtype=np.int64),
        surprise=np.zeros((0, 3)),
    )


def test_the_closed_fraction_by_hand():
    before, after = gap(np.full((40, 2), 3.0)), gap(np.full((40, 2), 2.0))
    found = closed_fraction(before, after)  # (9 + 9) − (4 + 4) of (9 + 9) − (1 + 1)
    assert found.value == pytest.approx(10.0 / 16.0)
    assert found.interval == pytest.approx((10.0 / 16.0, 10.0 / 16.0)), "every second is like every other"
    lower = closed_fraction(before, gap(np.full((40, 2), 2.0), floor=0.5))  # the lower floor holds for both
    assert lower.value == pytest.approx((72.0 - 32.0) / (72.0 - 2.0))
    assert np.isnan(closed_fraction(gap(np.full((40, 2), 0.9)), after).value), "no gap, nothing to close"


def test_the_interval_of_the_closed_fraction_knows_that_neighbours_are_alike():
    """Windows of one second share their error: sixty of them are worth sixty, not six hundred."""
    rng = np.random.default_rng(1)
    held, trials = 0, 200
    for _ in range(trials):
        b, a = (np.repeat(size * rng.standard_normal((60, 2)), 10, axis=0) for size in (3.0, 1.5))
        low, high = closed_fraction(gap(b), gap(a)).interval
        held += low <= (9.0 - 2.25) / (9.0 - 1.0) <= high
    assert held >= 0.88 * trials, held  # 60 % if the windows counted one by one


def test_a_play_has_no_error_bar() -> None:
    """Fits of its width end in one of many optima, 15 to 45 nats below the truth on two rigs: z-scores of 5 and 9."""
    log, plant = loop_log("arm_backlash", T=0.004, duration=6.0)
    estimate = identify(log, plant)
    (play,) = estimate.plant.effects
    assert "b" not in play.std
    assert np.isinf(estimate.std[estimate.names.index("arm_backlash.b")])
    assert np.isinf(estimate.std[estimate.names.index("arm_backlash.ρ")]), "it goes with the width"
    assert np.isfinite(estimate.std[:9]).all()
    assert np.isfinite(estimate.correlation).all()
    assert estimate.to_dict()["parameters"]["arm_backlash.b"]["std"] is None
    assert "likelihood too rough for an error" in str(estimate)
    assert Plant.from_dict(estimate.plant.to_dict()) == estimate.plant


@pytest.fixture(scope="module")
def tilted() -> Estimate:
    """A tilt's weight moment beside a cable: the data hardly see it."""
    effects = [HiddenEffect("arm_cable", 1.3), HiddenEffect("base_tilt", 2.7)]
    log = bench_log(Rig("desk", effects, individual=3), "paper", seed=1, duration=10.0)
    return identify(log, effects=["arm_cable", "base_tilt"])


def test_what_other_parameters_imitate_has_the_error_bar_of_its_profile(tilted: Estimate) -> None:
    """One standard deviation away from the optimum, with all others refitted, twice the loss of log-likelihood is about
    one."""
    problem, optimum = tilted.problem, tilted.optimum
    assert problem is not None
    assert optimum is not None
    name = "base_tilt.G1"
    i = [c.name for c in problem.coordinates].index(name)
    deviation = tilted.std[tilted.names.index(name)] / problem.coordinates[i].slope(optimum.z[i])
    for side in (-1.0, 1.0):
        z = optimum.z.copy()
        z[i] += side * deviation
        refitted = minimise(problem, z, 30, free=[k for k in range(len(z)) if k != i])
        assert 0.3 < 2.0 * (refitted.value - optimum.value) < 3.0


def test_an_error_bar_does_not_depend_on_the_step_of_the_differences(tilted: Estimate) -> None:
    problem, optimum = tilted.problem, tilted.optimum
    assert problem is not None
    assert optimum is not None
    own = [i for i, c in enumerate(problem.coordinates) if c.of_plant]
    found = []
    for factor in (0.3, 1.0, 3.0):
        other = copy.copy(problem)
        other.coordinates = [c if c.noise else replace(c, step=factor * c.step) for c in problem.coordinates]
        information = other.expand(optimum.z, exact=True, central=True).information
        found.append(np.sqrt(np.diag(inverse_information(information)))[own])
    assert found[0] == pytest.approx(found[1], rel=0.1)
    assert found[2] == pytest.approx(found[1], rel=0.1)


def test_an_end_of_a_profile_is_a_crossing_a_bound_or_open() -> None:
    z, deviance = np.arange(-2.0, 3.0), np.array([5.0, 1.0, 0.0, 1.0, 5.0])
    crossing = 1.0 + (math.sqrt(3.84) - 1.0) / (math.sqrt(5.0) - 1.0)  # the signed root is straight between points
    assert _crossing(z, deviance, 1, bound=9.0) == pytest.approx(crossing)
    assert _crossing(z, deviance, -1, bound=-9.0) == pytest.approx(-crossing)
    assert _crossing(z[1:], deviance[1:], -1, bound=-1.0) == -1.0
    low = _crossing(z[1:], deviance[1:], -1, bound=-9.0)  # the fits beyond it diverge
    assert math.isnan(low)
    told = Profile("theta2", z, deviance, (low, crossing))
    assert "interval open to 1.77" in str(told)
    assert told.to_dict()["interval"] == [None, pytest.approx(crossing)]
