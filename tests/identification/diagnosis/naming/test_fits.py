"""One structure fitted as well as is asked for."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from furuta_gym.plant import TABLE_3
from identification.diagnosis.naming.fits import Fit, FitRequest, anchored, fit
from identification.diagnosis.naming.forward import START_NOISE
from identification.diagnosis.policy import DecisionPolicy
from identification.kalman.coordinates import plant_coordinates
from identification.kalman.record import stretches
from tests.factories import loop_log


def test_a_coarse_fit_ends_where_no_more_than_a_standstill_is_promised() -> None:
    """What its derivatives promise there is less than `stands`, and so is what another descent brings."""
    log, _ = loop_log(duration=4.0)
    start = TABLE_3.replace(theta=1.2 * TABLE_3.theta)

    def coarse(stands: float) -> Fit:
        records = [stretch.record for stretch in stretches([log])]
        policy = replace(DecisionPolicy(), stands=stands)
        return fit(FitRequest(start, START_NOISE, records, policy=policy, effort="coarse"))

    rough, fine = coarse(20.0), coarse(0.01)
    assert rough.optimum.converged
    assert fine.optimum.converged
    assert 0.01 < rough.promised < 20.0
    assert fine.promised < 0.01
    assert rough.optimum.iterations < fine.optimum.iterations
    assert 0.0 < rough.value - fine.value < 20.0
    assert coarse(1e9).optimum.iterations == 1, "there it starts"


def test_nothing_finite_is_promised_where_the_filter_diverges() -> None:
    log, _ = loop_log(duration=1.0)
    (stretch,) = stretches([log])
    lost = fit(FitRequest(TABLE_3, START_NOISE, [stretch.record], iterations=1, effort="coarse"))
    assert math.isfinite(lost.promised)
    assert math.isinf(replace(lost, optimum=replace(lost.optimum, value=math.inf)).promised)


def test_the_strain_is_what_a_fit_without_the_prior_gains() -> None:
    """Around the truth the prior costs next to nothing; a stiff one around another pendulum holds the fit back."""
    log, truth = loop_log(duration=6.0)
    records = [stretch.record for stretch in stretches([log])]
    free = fit(FitRequest(truth, START_NOISE, records, effort="full"))
    assert free.strain == 0.0
    assert fit(FitRequest(truth, START_NOISE, records, anchor=truth, effort="full")).strain < 1.0
    away = truth.replace(theta=truth.theta * [1, 1.1, 1.1, 1.1, 1.1, 1, 1, 1, 1])
    stiff = replace(DecisionPolicy(), anchor_std=0.01)
    held = fit(FitRequest(truth, START_NOISE, records, anchor=away, policy=stiff, effort="full"))
    problem = free.problem()
    gained = problem.value(np.array([c.to_z(v) for c, v in zip(held.coordinates, _values(held), strict=True)]))
    assert held.strain > 2.0
    assert held.strain == pytest.approx(gained - free.value, rel=0.5, abs=1.0)


def _values(fitted: Fit) -> list[float]:
    return [c.to_value(z) for c, z in zip(fitted.coordinates, fitted.optimum.z, strict=True)]


def test_an_anchor_whose_pendulum_counts_the_other_way_draws_no_logarithm() -> None:
    """θ3 below zero is a plant whose q2 has the other sign; what is fitted may have it above."""
    (third,) = [c for c in plant_coordinates(TABLE_3) if c.name == "theta3"]
    other = TABLE_3.replace(theta=TABLE_3.theta * [1, 1, -1, 1, 1, 1, 1, 1, 1])
    assert anchored(third, other, 0.5).weak_prior == third.weak_prior
    assert anchored(third, TABLE_3, 0.5).weak_prior == (math.log(TABLE_3.theta[2]), 0.5)
