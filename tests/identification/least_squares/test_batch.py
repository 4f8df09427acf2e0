"""Least squares (2), in one go, over time and recursively: exact where it must be, and honest where it is biased."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from furuta_gym.plant import TABLE_3
from identification.least_squares.batch import evolution, filtered_least_squares, solve
from identification.least_squares.filtered_model import FilteredModel, filtered_models
from identification.least_squares.recursive import recursive_least_squares
from identification.logs.log import Log
from identification.logs.reading import read_log
from tests.factories import paper_log


def model_of(theta: np.ndarray, n: int = 400, seed: int = 0, noise: float = 0.0) -> FilteredModel:
    """A made-up regression whose truth is θ, with columns of very different size."""
    rng = np.random.default_rng(seed)
    omega_f = rng.normal(size=(n, 2, 9)) * np.logspace(-2, 1, 9)
    u_f = omega_f @ theta + noise * rng.normal(size=(n, 2))
    return FilteredModel(0.002 * np.arange(n), omega_f, u_f, 10.0, 100.0, 0.07)


thetas = st.lists(st.floats(0.001, 1.0), min_size=9, max_size=9).map(np.array)


@settings(max_examples=25)
@given(thetas, st.integers(0, 1000))
def test_batch_recovers_theta_exactly(theta, seed):
    estimate = solve([model_of(theta, seed=seed)])
    np.testing.assert_allclose(estimate.theta, theta, rtol=1e-9)
    assert estimate.samples == 400
    assert estimate.residual_rms.max() < 1e-9


def test_classical_covariance_is_right_where_its_assumptions_hold():
    theta = TABLE_3.theta
    found = np.array([solve([model_of(theta, seed=s, noise=0.1)]).theta for s in range(300)])
    stated = solve([model_of(theta, seed=0, noise=0.1)])
    np.testing.assert_allclose(found.std(axis=0), stated.std, rtol=0.2)
    assert np.abs((found.mean(axis=0) - theta) / stated.std * np.sqrt(300)).max() < 4
    np.testing.assert_allclose(stated.residual_rms, 0.1, rtol=0.1)


def test_true_states_give_the_truth_in_the_limit_of_fast_sampling():
    """The whole path from a log, no sensor error: the error vanishes as T does (the position filter's part)."""
    errors = []
    for T in (0.002, 0.001, 0.0005):
        log, _ = paper_log(T, 10.0, None)
        errors.append(np.abs(filtered_least_squares(log).theta / TABLE_3.theta - 1)[[0, 2, 3, 4]].max())
    assert errors[0] > 2.5 * errors[1] > 2.5 * 2.5 * errors[2]
    assert errors[2] < 0.03


def test_encoders_bias_the_estimate_towards_zero_and_it_says_so():
    """Errata, row 8."""
    log, _ = paper_log(0.001, 20.0, 4096)
    estimate = filtered_least_squares(log, lam=10.0)
    ratio = estimate.theta / TABLE_3.theta
    assert (ratio[[2, 3, 4]] < 0.8).all()
    assert abs(ratio[0] - 1) < 0.1
    (note,) = [w for w in estimate.warnings if w.startswith("biased")]
    assert "raising λ from 10 to 30" in note
    assert "θ3 by -" in note
    assert "prediction-error" in note
    assert (np.abs(estimate.theta - TABLE_3.theta) > 10 * estimate.std)[[2, 3, 4]].all()


def test_no_bias_is_claimed_where_there_is_none():
    log, _ = paper_log(0.0005, 10.0, None)
    assert not any("biased" in w for w in filtered_least_squares(log, lam=3.0).warnings)


def test_a_filter_that_takes_motion_away_is_noticed():
    slow, _ = paper_log(0.005, 10.0, 4096)
    assert any("raise wc from 0.07" in w for w in filtered_least_squares(slow).warnings)
    assert not any("raise wc" in w for w in filtered_least_squares(slow, wc=0.5).warnings)


@pytest.mark.parametrize(("axis", "unknown"), [("q1", range(9)), ("q2", [1, 2, 3, 4, 6, 8])])
def test_an_axis_that_is_held_gives_no_number(axis, unknown):
    log, _ = paper_log()
    flicker = 0.1 + 2 * np.pi / 4096 * np.random.default_rng(0).integers(-1, 2, len(log))
    estimate = filtered_least_squares(replace(log, **{axis: flicker}))
    constant = filtered_least_squares(replace(log, **{axis: np.full(len(log), 0.1)}))
    assert np.isnan(constant.theta[list(unknown)]).all()
    assert np.isnan(estimate.theta[list(unknown)]).all()
    assert f"θ{unknown[-1] + 1} cannot be determined" in estimate.warnings[0]
    assert str(estimate).count("not excited") >= len(unknown)


def test_collinear_columns_are_not_guessed():
    model = model_of(TABLE_3.theta)
    omega_f = model.omega_f.copy()
    omega_f[:, :, 3] = 2 * omega_f[:, :, 6]
    estimate = solve([replace(model, omega_f=omega_f)])
    assert np.isnan(estimate.theta).nonzero()[0].tolist() == [3, 6]
    assert estimate.condition > 1e10
    assert set(np.argsort(-np.abs(estimate.weakest))[:2]) == {3, 6}


def test_the_estimate_prints_a_verdict():
    log, _ = paper_log()
    estimate = filtered_least_squares(replace(log, input_unit="N·m"))
    text = str(estimate)
    for part in ("N·m", "λ = 10 1/s", "r = 100 s/rad", "wc = 0.07", "ignores bias", "weakest direction", "! biased"):
        assert part in text
    assert sum(line.startswith("  θ") for line in text.splitlines()) == 9


def test_several_logs_are_one_regression():
    first, second = (paper_log(0.002, 6.0, 4096, seed=s)[0] for s in (0, 1))
    models = filtered_models([first, second])
    Y = np.concatenate([m.omega_f.reshape(-1, 9) for m in models])
    u = np.concatenate([m.u_f.ravel() for m in models])
    normal = np.linalg.solve(Y.T @ Y, Y.T @ u)
    np.testing.assert_allclose(filtered_least_squares([first, second]).theta, normal, rtol=1e-6)


# --- over time --------------------------------------------------------------------------------------------


def test_evolution_is_the_batch_estimate_of_each_head():
    log, _ = paper_log()
    models = filtered_models(log)
    history = evolution(models, points=50)
    assert len(history.t) == 50
    for m in (20, 35, 49):
        n = round(history.t[m] / 0.002) + 1
        head = replace(models[0], t=models[0].t[:n], omega_f=models[0].omega_f[:n], u_f=models[0].u_f[:n])
        np.testing.assert_allclose(history.theta[m], solve([head]).theta, rtol=1e-7)
    np.testing.assert_allclose(history.last, solve(models).theta, rtol=1e-7)


def test_evolution_is_silent_until_theta_is_determined():
    model = model_of(TABLE_3.theta, n=40)
    history = evolution([model], points=40)
    assert np.isnan(history.theta[:4]).all()  # 9 unknowns need 5 samples of 2 rows
    np.testing.assert_allclose(history.theta[9:], np.tile(TABLE_3.theta, (31, 1)), rtol=1e-6)


@pytest.mark.parametrize("logs", [1, 2])
def test_recursive_without_forgetting_is_the_batch_estimate(logs):
    models = filtered_models([paper_log(0.002, 10.0, 4096, seed=s)[0] for s in range(logs)])
    recursive = recursive_least_squares(models)
    history = evolution(models, points=100)
    assert len(recursive.t) == sum(len(m.t) for m in models)
    np.testing.assert_allclose(recursive.last, solve(models).theta, rtol=1e-6)
    at = np.searchsorted(recursive.t, history.t - 1e-6)
    late = history.t > 1.0
    np.testing.assert_allclose(recursive.t[at], history.t, atol=1e-9)
    np.testing.assert_allclose(recursive.theta[at][late], history.theta[late], rtol=1e-4, atol=1e-6)


def test_recursive_with_forgetting_is_weighted_batch():
    mu, model = 0.99, model_of(TABLE_3.theta, n=300, noise=0.05)
    recursive = recursive_least_squares(model, forgetting=mu)
    for k in (50, 299):
        weight = np.repeat(np.sqrt(mu) ** np.arange(k, -1, -1), 2)
        Y, u = model.omega_f[: k + 1].reshape(-1, 9), model.u_f[: k + 1].ravel()
        expected = np.linalg.lstsq(Y * weight[:, None], u * weight, rcond=None)[0]
        np.testing.assert_allclose(recursive.theta[k], expected, rtol=1e-6)


def test_forgetting_follows_a_change_and_plain_does_not():
    before, after = TABLE_3.theta, TABLE_3.theta * np.array([1.5, 1, 1, 1, 1, 1, 1, 2.0, 1])
    first, second = model_of(before, n=2000, seed=1, noise=0.01), model_of(after, n=2000, seed=2, noise=0.01)
    follows = recursive_least_squares([first, second], forgetting=0.99).last
    mixes = recursive_least_squares([first, second]).last
    np.testing.assert_allclose(follows[[0, 7]], after[[0, 7]], rtol=0.05)
    assert mixes[7] == pytest.approx((before[7] + after[7]) / 2, rel=0.1)


def test_recursive_starts_from_what_is_known():
    model = model_of(TABLE_3.theta, n=50, noise=1.0)
    held = recursive_least_squares(model, theta0=TABLE_3.theta, prior_information=1e9)
    np.testing.assert_allclose(held.theta, np.tile(TABLE_3.theta, (50, 1)), atol=1e-4)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"forgetting": 0.0}, r"factor in \(0, 1\]"),
        ({"forgetting": 1.1}, "forgetting = 1.1"),
        ({"prior_information": 0.0}, "positive"),
        ({"theta0": np.zeros(8)}, "9 finite numbers"),
    ],
)
def test_recursive_refuses_what_makes_no_sense(options, message):
    with pytest.raises(ValueError, match=message):
        recursive_least_squares(model_of(TABLE_3.theta, n=20), **options)


# --- measured logs ----------------------------------------------------------------------------------------


def test_measured_chirps_give_the_size_that_others_found(real_data):
    """θ1 … θ5 and θ5/θ4 within what independent fits of these logs reported (data README), no more."""
    logs = [
        read_log(real_data / f"qube_darmstadt/chirp_{s}1V5_250Hz_00.csv", pendulum_zero="hanging", flip="q2")
        for s in "pm"
    ]
    estimate = filtered_least_squares(logs, wc=0.2)
    low = np.array([0.05, 0.015, 0.022, 0.022, 2.7])
    high = np.array([0.07, 0.027, 0.030, 0.030, 3.4])
    assert ((low < estimate.theta[:5]) & (estimate.theta[:5] < high)).all(), estimate
    assert np.sqrt(estimate.theta[4] / estimate.theta[3]) / (2 * np.pi) == pytest.approx(1.755, abs=0.05)
    assert any("negative" in w for w in estimate.warnings)


def test_log_made_of_arrays_is_enough():
    log, _ = paper_log()
    bare = Log(log.t, log.q1, log.q2, log.u)
    np.testing.assert_array_equal(filtered_least_squares(bare).theta, filtered_least_squares(log).theta)
