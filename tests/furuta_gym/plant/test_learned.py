"""A learned torque: its surface against SciPy's B-splines, and against an effect that it can be."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.interpolate import BSpline

from furuta_gym.plant import EFFECTS, TABLE_3, Effect, Plant
from furuta_gym.plant.effects.learned import ANGLES, COEFFICIENTS, SPEEDS, surface_columns
from tests.factories import closed_loop

LOW, WIDTH, W = -0.6, 1.4, 2.0


def learned(coefficients: np.ndarray) -> Effect:
    values = dict(zip(COEFFICIENTS, np.ravel(coefficients).tolist(), strict=True))
    return Effect("arm_learned", {"low": LOW, "width": WIDTH, "w": W, **values})


def a_spring(k: float, q0: float) -> Effect:
    """−k (q1 − q0) between the edges: cubic splines with even knots repeat a straight line."""
    places = LOW + (np.arange(ANGLES) - 1) / (ANGLES - 3) * WIDTH
    return learned(np.repeat(-k * (places - q0), SPEEDS))


def test_the_surface_is_the_product_of_cubic_splines():
    rng = np.random.default_rng(0)
    q1, v1 = rng.uniform(LOW, LOW + WIDTH, 50), rng.normal(0.0, 3.0, 50)
    x = 1.0 + (ANGLES - 3) * (q1 - LOW) / WIDTH
    y = 1.0 + (SPEEDS - 3) * 0.5 * (1.0 + v1 / np.sqrt(v1**2 + W**2))
    angle = BSpline(np.arange(-2.0, ANGLES + 2), np.eye(ANGLES), 3, extrapolate=False)(x)
    speed = BSpline(np.arange(-2.0, SPEEDS + 2), np.eye(SPEEDS), 3, extrapolate=False)(y)
    expected = (angle[:, :, None] * speed[:, None, :]).reshape(50, -1)
    np.testing.assert_allclose(surface_columns(q1, v1, LOW, WIDTH, W), expected, atol=1e-14)


def test_beyond_what_was_seen_the_torque_stays_what_it_was():
    far = surface_columns(np.array([-9.0, LOW, 9.0, LOW + WIDTH]), np.full(4, 1e6), LOW, WIDTH, W)
    np.testing.assert_allclose(far[0], far[1], atol=1e-12)
    np.testing.assert_allclose(far[2], far[3], atol=1e-12)
    np.testing.assert_allclose(far.sum(axis=1), 1.0)


def test_a_surface_that_is_a_spring_moves_the_rig_as_the_spring_does():
    k, q0 = 0.3, 0.1
    spring = TABLE_3.with_effects(Effect("arm_spring", {"k": k, "q1n": q0}))
    surface = TABLE_3.with_effects(a_spring(k, q0))
    runs = [closed_loop(p, 0.002, 4.0, None, 3) for p in (TABLE_3, spring, surface)]
    bare, one, other = (run.state[:, :2] for run in runs)
    assert LOW < one[:, 0].min() < one[:, 0].max() < LOW + WIDTH, "the whole run lies on the surface"
    np.testing.assert_allclose(other, one, atol=1e-9)
    assert np.abs(bare - one).max() > 1e-3


def test_a_plant_file_keeps_it(tmp_path):
    plant = TABLE_3.with_effects(a_spring(0.3, 0.1))
    plant.save(tmp_path / "rig.json")
    again = Plant.load(tmp_path / "rig.json")
    assert again.effects == plant.effects
    entry = json.loads((tmp_path / "rig.json").read_text())["effects"][0]
    assert entry["parameters"]["c00"]["unit"] == TABLE_3.unit
    assert f"{ANGLES * SPEEDS} coefficients up to" in str(plant)


def test_it_is_no_name_that_a_search_could_propose():
    assert "arm_learned" not in EFFECTS
    with pytest.raises(ValueError, match="arm_learned"):
        Effect("arm_learnt")
    with pytest.raises(ValueError, match="width must lie in"):
        Effect("arm_learned", {"width": 0.0})
