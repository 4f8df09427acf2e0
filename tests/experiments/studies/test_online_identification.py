"""The on-line identifiers beside the batch methods, in a small size."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from experiments.studies import online_identification as online
from experiments.studies.identification_benchmark.cases import Case
from furuta_gym.plant import PLANTS, Effect

CASE = Case("qube", 0.005, 4096, duration=8.0)


@pytest.fixture(scope="module")
def run() -> online.Run:
    return online.follow(CASE, 0)


def test_the_truth_steps_with_the_payload() -> None:
    plant = PLANTS["qube"].with_effects(Effect("payload_step", {"m": 0.3, "t0": 1.0}))
    theta = online.true_theta(plant, np.array([0.0, 0.99, 1.01, 5.0]))
    assert theta[:2] == pytest.approx(np.tile(plant.theta, (2, 1)))
    assert theta[2:, 4] == pytest.approx(1.3 * plant.theta[4])
    assert theta[2:, 5:] == pytest.approx(np.tile(plant.theta[5:], (2, 1)))


def test_recursion_ends_where_its_batch_method_is_and_the_filter_nearer_the_truth(run: online.Run) -> None:
    recursive, _, ekf, _ = run.courses
    batch = run.batch["filtered-ls"]
    assert recursive.theta[-1] == pytest.approx(batch, rel=1e-3)
    assert ekf.theta.shape == (len(run.log), 9)
    strong = [0, 2, 3, 4]
    off = [np.abs(theta[strong] / run.truth[-1][strong] - 1.0).max() for theta in (recursive.theta[-1], ekf.theta[-1])]
    assert off[1] < off[0]
    assert all(c.cost_us > 0 for c in run.courses)


def test_table_and_json_hold_every_method(run: online.Run) -> None:
    table = online.table([run])
    for name in ("RLS", "EKF", "filtered-ls (batch)", "prediction-error (batch)"):
        assert name in table
    found = online.to_json([run])["runs"][0]
    assert [o["method"] for o in found["online"]] == [c.name for c in run.courses]
    assert found["truth"]["theta5"] == pytest.approx(PLANTS["qube"].theta[4])


def test_the_plot_is_written(run: online.Run, tmp_path: Path) -> None:
    online.plot(run, tmp_path / "x.png")
    assert (tmp_path / "x.png").stat().st_size > 20_000


def test_an_unknown_rig_is_refused(tmp_path: Path) -> None:
    import typer

    app = typer.Typer()
    app.command()(online.main)
    result = CliRunner().invoke(app, ["--rig", "quube", "-o", str(tmp_path)])
    assert result.exit_code != 0
