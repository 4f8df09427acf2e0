"""Plants drawn from what identification left uncertain."""

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import norm

from furuta_gym.plant import LARGE_RIG, QUBE, TABLE_3, THETA_NAMES, Covariance, Effect, sampled_plants
from furuta_gym.plant.covariance import NORMAL_95
from furuta_gym.plant.sampling import spread_of


def around(plant, relative, names=THETA_NAMES) -> Covariance:
    values = dict(zip(THETA_NAMES, plant.theta, strict=True))
    return Covariance(names, np.diag([(relative * values[name]) ** 2 for name in names]))


def test_equal_covariances_are_equal_and_hash_alike():
    one, same = (Covariance(("theta1", "r"), [[2.0, 0.5], [0.5, 1.0]]) for _ in range(2))
    assert one == same
    assert len({one, same}) == 1
    assert one != Covariance(("theta1", "r2"), one.matrix)
    assert one != Covariance(one.names, 2.0 * one.matrix)
    assert one.without("theta1") == Covariance(("r",), [[1.0]])
    assert one.without("r", "theta1").names == ()


def test_draws_have_the_stated_mean_and_spread():
    names = ("theta1", "theta4", "theta5")
    std = 0.02 * LARGE_RIG.theta[[0, 3, 4]]
    matrix = np.outer(std, std) * np.array([[1, 0.6, 0.0], [0.6, 1, -0.3], [0.0, -0.3, 1]])
    plant, rng = LARGE_RIG.replace(covariance=Covariance(names, matrix)), np.random.default_rng(1)
    drawn = np.array([p.theta[[0, 3, 4]] for p in sampled_plants(plant, 4000, rng)])
    np.testing.assert_allclose(drawn.mean(axis=0), LARGE_RIG.theta[[0, 3, 4]], atol=5 * std.max() / np.sqrt(4000))
    np.testing.assert_allclose(np.cov(drawn.T), matrix, atol=0.1 * np.diag(matrix).max())


def test_draws_touch_only_what_was_estimated():
    plant = LARGE_RIG.replace(covariance=around(LARGE_RIG, 0.1, ("theta2",)))
    for drawn in sampled_plants(plant, 20, np.random.default_rng(2)):
        assert drawn.theta[1] != plant.theta[1]
        np.testing.assert_array_equal(np.delete(drawn.theta, 1), np.delete(plant.theta, 1))


def test_draws_stay_possible_even_when_most_are_not():
    """At 60 % uncertainty many normal draws have negative friction or M that is not positive definite."""
    plant = TABLE_3.replace(covariance=around(TABLE_3, 0.6))
    drawn = list(sampled_plants(plant, 200, np.random.default_rng(3)))
    assert len(drawn) == 200
    for p in drawn:
        assert (p.theta[5:] >= 0).all()
        assert p.theta[0] * p.theta[3] > p.theta[2] ** 2


def test_effect_parameters_and_sharpness_are_drawn_within_bounds():
    names, matrix = ("arm_spring.k", "arm_stribeck.ΔF", "r"), np.diag([0.2**2, 0.01**2, 30.0**2])
    plant = LARGE_RIG.with_effects(
        Effect("arm_spring", {"k": 0.2, "q1n": 0.3}), Effect("arm_stribeck", {"ΔF": 0.05})
    ).replace(covariance=Covariance(names, matrix))
    drawn = list(sampled_plants(plant, 300, np.random.default_rng(4)))
    k = np.array([p.effect("arm_spring").parameters["k"] for p in drawn])
    assert k.min() >= 0
    assert k.std() > 0.05
    assert {p.effect("arm_spring").parameters["q1n"] for p in drawn} == {0.3}
    assert np.std([p.effect("arm_stribeck").parameters["ΔF"] for p in drawn]) == pytest.approx(0.01, rel=0.2)
    r = np.array([p.sharpness for p in drawn])
    np.testing.assert_array_equal(r[:, 0], r[:, 1])
    assert r.min() > 0
    assert r.std() > 15


def test_equal_seeds_draw_equal_plants_and_others_do_not():
    plant = LARGE_RIG.replace(covariance=around(LARGE_RIG, 0.05))
    first, again, other = (list(sampled_plants(plant, 3, np.random.default_rng(s))) for s in (5, 5, 6))
    assert first == again
    assert first[0] != other[0]


def test_what_the_log_did_not_show_is_drawn_as_a_rigid_body_has_it():
    """A small motion around hanging says nothing of θ2: its error bar is twenty times its value."""
    std = np.where(np.arange(9) == 1, 20.0, 0.01) * QUBE.theta
    plant = QUBE.replace(
        covariance=Covariance(THETA_NAMES, np.diag(std**2)),
        checks={"identifiability": {"not_identified": ["theta2", "arm_spring.k"]}},
    )
    theta = np.array([p.theta for p in sampled_plants(plant, 400, np.random.default_rng(6))])
    low, high = QUBE.theta[2] ** 2 / QUBE.theta[0], QUBE.theta[3]
    assert low <= theta[:, 1].min() < low + 0.05 * (high - low)
    assert high >= theta[:, 1].max() > high - 0.05 * (high - low)
    np.testing.assert_allclose(np.delete(theta.std(axis=0) / std, 1), 1.0, atol=0.15)
    assert f"θ2 evenly between {low:.3g} and {high:.3g}" in spread_of(plant).told
    assert "(not identified)" in str(plant)
    assert spread_of(plant.replace(checks={})).told == ""


def test_a_scale_that_the_log_did_not_show_varies_by_about_half_and_keeps_its_ratios():
    row = ("theta3", "theta4", "theta5")
    values = QUBE.theta[2:5]
    plant = QUBE.replace(
        covariance=Covariance(row, 25.0 * np.outer(values, values)),
        checks={"identifiability": {"not_identified": list(row)}},
    )
    drawn = np.array([p.theta[2:5] for p in sampled_plants(plant, 400, np.random.default_rng(7))]) / values
    np.testing.assert_allclose(drawn.std(axis=0), 0.25, rtol=0.15)
    np.testing.assert_allclose(drawn[:, 0], drawn[:, 2], rtol=1e-4)
    assert drawn.min() > 0
    assert "θ3, θ4, θ5 within about half" in spread_of(plant).told


def test_no_covariance_or_a_hopeless_one_is_an_error_that_says_what_to_do():
    with pytest.raises(ValueError, match="identify"):
        list(sampled_plants(LARGE_RIG, 1, np.random.default_rng(0)))
    impossible = LARGE_RIG.with_effects(Effect("input_gain_asymmetry", {"a": 0.0})).replace(
        covariance=Covariance(("input_gain_asymmetry.a",), np.array([[1e12]]))
    )
    with pytest.raises(ValueError, match="uncertain"):
        list(sampled_plants(impossible, 1, np.random.default_rng(0)))


BAD = {
    "wrong size": (("theta1",), np.eye(2)),
    "not square": (("theta1", "theta2"), np.ones((2, 3))),
    "not symmetric": (("theta1", "theta2"), [[1.0, 0.5], [0.0, 1.0]]),
    "negative": (("theta1",), [[-1.0]]),
    "indefinite": (("theta1", "theta2"), [[1.0, 2.0], [2.0, 1.0]]),
    "NaN": (("theta1",), [[np.nan]]),
    "a name twice": (("theta1", "theta1"), np.eye(2)),
}


@pytest.mark.parametrize(("names", "matrix"), BAD.values(), ids=BAD)
def test_what_is_no_covariance_is_an_error(names, matrix):
    with pytest.raises(ValueError, match="covariance"):
        Covariance(names, np.array(matrix))


def test_small_asymmetry_in_small_entries_is_seen_too():
    """Scales of θ differ by orders: an asymmetry is judged against its own entries' scale."""
    with pytest.raises(ValueError, match="symmetric"):
        Covariance(("theta5", "theta7", "theta9"), [[1.0, 0, 0], [0, 1e-10, 9e-11], [0, -9e-11, 1e-10]])


def test_a_bare_nine_by_nine_list_is_over_theta():
    assert Covariance.from_dict(np.eye(9).tolist()).names == THETA_NAMES
    with pytest.raises(ValueError, match="9"):
        Covariance.from_dict(np.eye(8).tolist())


def test_the_ends_of_a_95_percent_interval_are_exact_and_stand_in_one_place():
    assert pytest.approx(norm.ppf(0.975), rel=1e-15) == NORMAL_95
    root = Path(__file__).parents[3]
    packages = ("furuta_gym", "identification", "controllers", "experiments")
    files = [file for package in packages for file in (root / package).rglob("*.py")]
    holding = [file.name for file in files if re.search(r"= 1\.9[56]\d*\b", file.read_text(encoding="utf-8"))]
    assert holding == ["covariance.py"]
