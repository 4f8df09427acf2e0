"""Coordinates of effects' parameters: their priors and bounds."""

from __future__ import annotations

import math

import pytest

from furuta_gym.plant import QUBE, TABLE_3, Effect
from identification.kalman.coordinates import plant_coordinates


def coordinate(effect: Effect, parameter: str):
    """Of one parameter, of a QUBE with the effect."""
    found = plant_coordinates(QUBE.with_effects(effect))
    return next(c for c in found if c.name == f"{effect.name}.{parameter}")


def test_a_share_has_a_log_normal_prior_within_its_bounds() -> None:
    share = coordinate(Effect("arm_backlash", {"b": 0.01, "rho": 0.3}), "ρ")
    assert share.log
    assert share.weak_prior == (pytest.approx(math.log(0.1)), 1.0)
    assert (share.low, share.high) == (0.001, 0.9)


def test_a_shape_that_may_be_zero_has_a_normal_prior() -> None:
    sweep = coordinate(Effect("pendulum_quadratic_drag", {"c": 0.01, "lambda": 0.5}), "λ")
    assert not sweep.log
    assert sweep.weak_prior == (0.0, 1.0)
    assert sweep.to_value(sweep.to_z(0.7)) == pytest.approx(0.7)
    assert (sweep.low, sweep.high) == (0.0, 3.0)


def test_what_was_learned_is_no_coordinate() -> None:
    """Its coefficients and its range stay as they were learned while θ moves."""
    learned = plant_coordinates(TABLE_3.with_effects(Effect("arm_learned", {"c00": 0.1})))
    assert [c.name for c in learned] == [c.name for c in plant_coordinates(TABLE_3)]
