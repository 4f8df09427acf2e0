"""The door of `identify`: estimators by name, options that a method does not use, the command's limit."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from experiments.cli.app import app
from furuta_gym import Plant
from identification import Estimate, Log, identify, read_log, write_log
from identification.estimation.identifiability import Motion, judge
from identification.estimation.methods import METHODS, Method
from identification.kalman.noise_model import Noise
from tests.factories import paper_log


@pytest.fixture(scope="module")
def log() -> Log:
    return paper_log(T=0.005, duration=6.0)[0]


class Table3:
    """A toy: whatever the logs, θ is Table 3 with 1 % of error, times `sharpness`, the one option that it uses."""

    def estimate(
        self, logs: Sequence[Log], template: Plant, start: Plant | None, /, *, sharpness: float | None
    ) -> Estimate:
        from furuta_gym.plant import TABLE_3, THETA_NAMES

        theta = TABLE_3.theta
        covariance = np.diag((0.01 * theta) ** 2)
        verdict = judge(THETA_NAMES, theta, np.linalg.inv(covariance), Motion.of(logs), 0.01 * theta)
        plant = template.replace(theta=theta, friction_sharpness=sharpness or 100.0)
        return Estimate(plant, "table3", THETA_NAMES, theta, covariance, verdict)


@pytest.fixture
def toy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(METHODS, "table3", Method(__name__, "Table3", "what the paper printed"))


@pytest.mark.usefixtures("toy")
def test_an_estimator_that_is_registered_is_known_in_python_and_on_the_command_line(log: Log, tmp_path: Path) -> None:
    found = identify(log, method="table3", sharpness=70.0)
    assert found.plant.friction_sharpness == 70.0
    assert found.plant.provenance["method"] == "table3"
    assert found.plant.covariance is not None
    with pytest.raises(ValueError, match=r"'table3' does not use physical"):
        identify(log, method="table3", physical=True)

    write_log(tmp_path / "log.csv", log)
    arguments = ["identify", str(tmp_path / "log.csv"), "-o", str(tmp_path / "rig.json"), "--method", "table3"]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    assert Plant.load(tmp_path / "rig.json").theta == pytest.approx(found.values)


@pytest.mark.parametrize("method", ["filtered-ls", "recursive-ls", "ekf"])
@pytest.mark.parametrize(
    "option",
    [
        {"fixed": {"theta1": 0.06}},
        {"priors": {"theta1": (0.06, 0.01)}},
        {"effects": ["arm_spring"]},
        {"physical": True},
        {"sharpness": 100.0},
        {"negative_friction": True},
        {"iterations": 3},
        {"noise": Noise((1.0, 1.0))},
    ],
    ids=lambda option: next(iter(option)),
)
def test_an_option_that_the_method_ignores_is_refused(log: Log, method: str, option: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=rf"{method}.* does not use {next(iter(option))}"):
        identify(log, method=method, **option)


def test_an_unknown_method_is_refused_with_the_names_there_are(log: Log, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="prediction-error, filtered-ls, recursive-ls, ekf"):
        identify(log, method="magic")
    result = CliRunner().invoke(app, ["identify", "no.csv", "-o", str(tmp_path / "rig.json"), "--method", "magic"])
    assert result.exit_code == 2
    assert "filtered-ls" in result.stderr


@pytest.mark.usefixtures("toy")
def test_the_limit_of_the_command_is_an_argument_and_in_the_file(log: Log) -> None:
    guessed, given = identify(log, method="table3"), identify(log, method="table3", u_max=24.0)
    assert guessed.u_max_guessed
    assert not given.u_max_guessed
    assert "u_max" in str(guessed)
    assert "u_max" not in str(given)
    assert given.plant.u_max == 24.0
    assert given.plant.provenance["u_max"] == "given"
    assert guessed.plant.provenance["u_max"].startswith("guessed")
    assert np.array_equal(given.values, guessed.values)
    kept = identify(log, given.plant, method="table3")
    assert (kept.plant.u_max, kept.u_max_guessed) == (24.0, False)


@pytest.mark.parametrize("u_max", [0.01, -1.0, float("nan")])
def test_a_limit_below_the_command_is_refused(log: Log, u_max: float) -> None:
    with pytest.raises(ValueError, match="reaches"):
        identify(log, method="filtered-ls", u_max=u_max)


@pytest.mark.usefixtures("toy")
def test_what_was_skipped_is_in_the_plant_file(log: Log, tmp_path: Path) -> None:
    write_log(tmp_path / "log.csv", log)
    entries = [
        identify(read_log(tmp_path / "log.csv", skip=skip), method="table3").plant.provenance["logs"][0]
        for skip in (0.0, 1.5)
    ]
    assert [entry.get("skipped_s") for entry in entries] == [None, 1.5]
    assert entries[0]["duration_s"] - entries[1]["duration_s"] == pytest.approx(1.5, abs=0.006)
