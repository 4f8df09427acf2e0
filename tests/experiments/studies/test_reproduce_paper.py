"""The paper's experiment in a small size: its method is biased as the documentation says, the other is not."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest

from experiments.studies.reproduce_paper import (
    CASES,
    SCHEMA,
    TRUTH,
    Arguments,
    Results,
    cause_table,
    estimate_table,
    findings,
    run,
    save,
)
from furuta_gym.plant import TABLE_3, THETA_NAMES

SCALED = [2, 3, 4, 8]  # θ3, θ4, θ5, θ9: the second row gives their ratios only


@pytest.fixture(scope="module")
def results() -> Results:
    return run(Arguments.quick())


def errors(results: Results, case: str, lam: float) -> np.ndarray:
    return next(c.error for c in results.causes if (c.case, c.lam) == (case, lam))


def test_the_experiment_keeps_the_pendulum_up(results):
    assert results.experiment.fell is None
    assert np.abs(results.experiment.state[:, 1]).max() < 0.2


def test_least_squares_is_biased_towards_zero_and_past_it(results):
    fits = results.fits
    assert (fits["LS, λ = 10"].error[SCALED] < -0.05).all()
    assert (fits["LS, λ = 30"].error[SCALED] < -1.0).all()  # the sign is lost
    assert fits["LS, λ = 30"].plant is None
    assert "no plant" in fits["LS, λ = 30"].note
    assert (fits["LS, λ = 100"].error[SCALED] < fits["LS, λ = 30"].error[SCALED]).all()
    stated = fits["LS, λ = 10"].std
    assert (np.abs(fits["LS, λ = 10"].theta - TABLE_3.theta) > 5 * stated)[[2, 3, 4]].all()


def test_prediction_error_finds_table_3(results):
    fit = results.fits["PE"]
    assert (np.abs(fit.theta - TABLE_3.theta) < 5 * fit.std).all()
    assert (np.abs(fit.error[[0, 2, 3, 4, 7, 8]]) < 0.15).all()
    biased = results.fits["LS, λ = 10"].error
    assert (np.abs(fit.error) < np.abs(biased))[SCALED].all()


@pytest.mark.parametrize("lam", Arguments().lambdas)
def test_the_bias_is_made_by_readings_in_the_arms_row(results, lam):
    """True velocities in the arm's row take most of it away, in the pendulum's row they do not help."""
    paper, no_arm, no_pendulum = (errors(results, CASES[i], lam)[2] for i in (4, 6, 5))
    assert no_arm > 0.5 * paper
    assert no_pendulum < 0.7 * paper
    assert np.abs(errors(results, CASES[0], lam)[2]) < np.abs(paper) / 4


def test_the_common_scale_is_lost_and_not_the_ratios(results):
    for i, fit in enumerate(results.fits[f"LS, λ = {lam:g}"] for lam in (10.0, 30.0)):
        ratio = (fit.theta[2] / fit.theta[4]) / (TABLE_3.theta[2] / TABLE_3.theta[4])
        assert abs(ratio - 1) < 0.25 * np.abs(fit.error[2])
        assert results.scale[i].error > results.scale[i].signal


def test_exact_readings_leave_the_position_filters_part(results):
    """It grows with λ, and stays below what encoders do."""
    exact = [results.fits[f"LS, exact readings, λ = {lam:g}"].error[2] for lam in results.arguments.lambdas]
    assert (np.diff(np.abs(exact)) > 0).all()
    assert abs(exact[1]) < 0.3 * abs(results.fits["LS, λ = 30"].error[2])


def test_history_ends_at_the_estimate_and_runs_are_reproducible(results):
    for name, history in results.histories.items():
        np.testing.assert_allclose(history.last, results.fits[name].theta, rtol=1e-6)
    a = results.arguments
    from experiments.studies.reproduce_paper import closed_loop

    again = closed_loop(TABLE_3, a, a.encoder_counts, a.torque_noise)
    np.testing.assert_array_equal(again.command, results.experiment.command)


def test_the_papers_check_does_not_see_the_bias(results):
    """Figures 3 and 4 look as good with a θ5 that is far off as with the truth."""
    truth, biased = results.misfit(TRUTH), results.misfit("LS, λ = 10")
    assert results.simulations["LS, λ = 10"].fell is None
    assert biased["q2_rad"] < 2 * truth["q2_rad"]
    (said,) = [line for line in findings(results) if "does not see the bias" in line]
    assert ("3λ does see it" in said) == results.fits["LS, λ = 10"].flagged


def test_everything_is_written(results, tmp_path):
    paths = save(results, tmp_path / "new")
    assert [p.name for p in paths] == ["figure2.png", "figure3.png", "figure4.png", "estimates.csv", "results.json"]
    assert all(p.stat().st_size > 1000 for p in paths)
    with paths[3].open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 9 * len(results.fits)
    assert {row["parameter"] for row in rows} == set(THETA_NAMES)
    found = json.loads(paths[4].read_text(encoding="utf-8"))
    assert found["schema"] == SCHEMA
    np.testing.assert_allclose(found["estimates"]["PE"]["theta"], results.fits["PE"].theta)
    assert estimate_table(results).row_count == 9
    assert cause_table(results).row_count == len(CASES) + 2
