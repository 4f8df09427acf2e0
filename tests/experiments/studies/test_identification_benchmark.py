"""The study of identification in a small size: bounds, records, tables, backends, and what it should find."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import experiments.studies.identification_benchmark.__main__ as command
from experiments.studies.identification_benchmark import starts
from experiments.studies.identification_benchmark.cases import Case, cases, sample
from experiments.studies.identification_benchmark.study import run
from experiments.studies.identification_benchmark.summary import cells, chance, to_json, verdict

CASE = Case("table3", 0.005, 4096, "paper", 4.0)


@pytest.fixture(scope="module")
def trials():
    return list(run([CASE], range(2), ["prediction-error", "filtered-ls"]))


def test_prediction_error_is_near_the_bound_where_least_squares_is_not(trials) -> None:
    ratio = {r["method"]: r["ratio"] for r in cells(trials)}
    assert np.sqrt(np.mean(ratio["prediction-error"] ** 2)) < 2.5
    assert np.median(ratio["filtered-ls"]) > 4.0


def test_the_bound_falls_with_the_length_of_the_log() -> None:
    short, long = (sample(replace(CASE, duration=d), 0).bound for d in (4.0, 16.0))
    assert np.median(short / long) == pytest.approx(2.0, rel=0.35)


def test_a_trial_follows_from_its_seed_alone(trials) -> None:
    again = next(iter(run([CASE], [1], ["filtered-ls"])))
    assert again.error["filtered-ls"] == pytest.approx(trials[1].error["filtered-ls"])
    assert again.bound == pytest.approx(trials[1].bound)


def test_bias_rmse_and_coverage_are_what_they_are_called(trials) -> None:
    made = [
        replace(t, error={"m": np.full(9, e)}, std={"m": np.full(9, 1.0)}, bound=np.full(9, 0.5), seconds={"m": 1.0})
        for t, e in zip(trials, (3.0, -1.0), strict=True)
    ]
    record = cells(made)[0]
    assert record["bias"] == pytest.approx(1.0)
    assert record["rmse"] == pytest.approx(np.sqrt(5.0))
    assert record["ratio"] == pytest.approx(2.0 * np.sqrt(5.0))
    assert record["coverage"] == pytest.approx(0.5)
    assert to_json([record], {})["cells"][0]["bias"]["theta1"] == pytest.approx(1.0)
    assert "above" in verdict([record | {"method": "prediction-error"}])


def test_chance_is_that_of_simulated_errors() -> None:
    errors = np.random.default_rng(0).standard_normal((20000, 10))
    assert np.mean(np.sqrt(np.mean(errors**2, axis=1)) > chance(10, 0.99)) == pytest.approx(0.01, abs=0.003)


def test_a_method_that_fails_is_counted_not_hidden(trials) -> None:
    failed = replace(trials[0], error={"m": np.full(9, np.nan)}, std={"m": np.full(9, np.nan)}, seconds={"m": 1.0})
    good = replace(failed, error={"m": np.zeros(9)}, std={"m": np.ones(9)})
    record = cells([failed, good])[0]
    assert (record["seeds"], record["failed"]) == (1, 1)


def test_mujoco_windows_finds_a_rigid_rig() -> None:
    pytest.importorskip("mujoco")
    from experiments.studies.identification_benchmark.mujoco_windows import fit

    drawn = sample(Case("large", 0.005, 4096, "hanging", 6.0), 0)
    theta, std = fit(drawn.log)
    assert theta[:5] == pytest.approx(drawn.truth[:5], rel=0.15)
    assert np.all(np.isfinite(std) & (std > 0))


def test_dask_gives_what_this_process_gives() -> None:
    pytest.importorskip("distributed")
    one = next(iter(run([CASE], [0], ["filtered-ls"])))
    other = next(iter(run([CASE], [0], ["filtered-ls"], backend="dask", jobs=1)))
    assert other.error["filtered-ls"] == pytest.approx(one.error["filtered-ls"])


def test_the_command_writes_json_tables_and_a_plot(tmp_path: Path) -> None:
    arguments = ["-o", str(tmp_path), "--rigs", "table3", "--times", "5", "--counts", "4096", "--duration", "4"]
    result = _invoke(*arguments, "--seeds", "1")
    assert result.exit_code == 0, result.output
    saved = json.loads((tmp_path / "identification_benchmark.json").read_text(encoding="utf-8"))
    assert saved["settings"]["seeds"] == 1
    assert saved["cells"][0]["ratio"]["theta1"] > 0
    assert "table3, 5 ms, 4096 counts" in (tmp_path / "identification_benchmark_tables.md").read_text(encoding="utf-8")
    assert (tmp_path / "identification_benchmark.png").stat().st_size > 0


@pytest.mark.parametrize(
    ("arguments", "word"),
    [(["--rigs", "moon"], "moon"), (["--methods", "magic"], "magic"), (["--backend", "fog"], "fog")],
)
def test_bad_arguments_are_sentences(tmp_path: Path, arguments: list[str], word: str) -> None:
    result = _invoke("-o", str(tmp_path), *arguments)
    assert result.exit_code == 2
    assert word in result.stderr


def test_all_combinations_are_cases() -> None:
    assert len(list(cases(["qube"], [1e-3, 2e-3], [2048, 4096], ["paper", "hanging"], 5.0))) == 8


def _invoke(*arguments: str):
    import typer

    app = typer.Typer()
    app.command()(command.main)
    return CliRunner().invoke(app, list(arguments))


def test_wrong_starts_arrive_and_are_counted() -> None:
    found = starts.fits(CASE, 3, 2)
    assert found.arrived == [True, True]
    assert "2 of 2" in starts.table([found]).splitlines()[-1]
    lost = replace(found, wrong=(found.truth, found.truth - 3.0))
    assert lost.arrived == [True, False]


def test_a_wrong_start_is_wrong_in_every_parameter() -> None:
    rng, theta = np.random.default_rng(0), CASE.plant.theta
    factors = np.array([starts.wrong_theta(theta, rng) / theta for _ in range(200)])
    assert factors.min(axis=0) == pytest.approx(np.full(9, 1 / 3), rel=0.1)
    assert factors.max(axis=0) == pytest.approx(np.full(9, 3.0), rel=0.1)
