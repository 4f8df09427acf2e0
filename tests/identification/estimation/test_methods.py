"""The door of `identify`: estimators by name, options that a method does not use, the command's limit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from experiments.cli.app import app
from furuta_gym import Plant
from furuta_gym.plant import TABLE_3
from identification import Estimate, Log, identify, read_log, write_log
from identification.design.signals import paper_signal
from identification.estimation.estimate import GainChange
from identification.estimation.identifiability import Motion, judge
from identification.estimation.identify import _limit
from identification.estimation.methods import METHODS, Method
from identification.kalman.noise_model import Noise
from identification.logs.rig_mapping import RigMapping
from tests.factories import paper_log


@pytest.fixture(scope="module")
def log() -> Log:
    return paper_log(T=0.005, duration=6.0)[0]


class Table3:
    """A toy: whatever the logs, θ is Table 3 with 1 % of error, times `sharpness`, the one option that it uses."""

    def estimate(
        self, logs: Sequence[Log], template: Plant, start: Plant | None, /, *, sharpness: float | None
    ) -> Estimate:
        from furuta_gym.plant import THETA_NAMES

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
        {"polished": False},
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


@pytest.mark.usefixtures("toy")
def test_the_limits_and_ranges_of_a_start_plant_stay(log: Log) -> None:
    """A controller made from the new plant must keep to them, and is trained over the same ranges."""
    limits, randomize = {"arm_travel": 1.2, "arm_speed": 9.0}, {"theta": "physical:0.2"}
    found = identify(log, TABLE_3.replace(limits=limits, randomize=randomize), method="table3")
    assert found.plant.limits == limits
    assert found.plant.randomize == randomize
    assert identify(log, method="table3").plant.limits is None


def test_a_command_of_few_values_says_nothing_of_the_amplifier(log: Log) -> None:
    """The paper's square waves stop at their largest sum; a clipped sine stops at what the amplifier gives."""
    squares = replace(log, u=np.asarray(paper_signal()(log.t)))
    clipped = replace(log, u=np.clip(4.0 * np.sin(9.0 * log.t) * np.sin(log.t), -3.0, 3.0))
    assert np.abs(squares.u).max() == 1.75
    assert _limit([squares]) == pytest.approx(3.0)
    assert _limit([clipped]) == 3.0


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


@pytest.mark.usefixtures("toy")
def test_a_start_plants_limit_below_the_command_is_not_kept(log: Log) -> None:
    largest = float(np.abs(log.u).max())
    start = identify(log, method="table3").plant.replace(u_max=0.5 * largest)
    with pytest.warns(UserWarning, match="the start plant's u_max is .* reaches .* --u-max"):
        found = identify(log, start, method="table3")
    assert found.plant.u_max >= largest
    assert found.u_max_guessed
    assert found.plant.provenance["u_max"].startswith("guessed")
    assert identify(log, start, method="table3", u_max=24.0).plant.u_max == 24.0


@pytest.mark.usefixtures("toy")
def test_the_sensors_are_those_of_the_log(log: Log) -> None:
    """Not those of a start plant, and not the declared counts where the readings contradict them."""
    start = identify(log, method="table3").plant.replace(sensors={"encoder_counts": [512, 512]})
    smooth = replace(log, q1=np.sin(log.t), q2=np.sin(3.0 * log.t), encoder_counts=None)
    assert identify(smooth, start, method="table3").plant.sensors is None
    for declared in (None, (1024.0, 1024.0), (4096.0, 4096.0)):
        sensors = identify(replace(log, encoder_counts=declared), start, method="table3").plant.sensors
        assert sensors is not None
        assert list(sensors["encoder_counts"]) == [4096.0, 4096.0]


@pytest.mark.usefixtures("toy")
def test_a_plant_file_carries_one_mapping_where_its_logs_have_one(log: Log) -> None:
    degrees, radians = RigMapping(unit_q1="deg", unit_q2="deg"), RigMapping(flip=("q2",), cut=((1.0, 2.0),))

    def stored(*mappings: RigMapping) -> dict[str, Any]:
        logs = [replace(log, mapping=mapping, q1=log.q1 + i) for i, mapping in enumerate(mappings)]
        return dict(identify(logs, method="table3").plant.provenance)

    assert stored(radians, radians.without("cut"))["mapping"] == {"flip": ["q2"]}
    unlike = stored(degrees, radians)
    assert "mapping" not in unlike
    assert [entry["mapping"] for entry in unlike["logs"]] == [{"unit_q1": "deg", "unit_q2": "deg"}, {"flip": ["q2"]}]


@pytest.mark.usefixtures("toy")
def test_a_script_reads_what_the_verdict_says(log: Log) -> None:
    change = GainChange("a.csv", 0.8, None, 9.0)
    estimate = replace(identify(log, method="table3"), gain_changes=(change,))
    told = estimate.to_dict()
    assert told["verdict"] == estimate.verdict
    assert "θ is a mean" in told["verdict"]
    assert told["uncertain"] == estimate.uncertain
    assert told["gain_changes"] == [{"source": "a.csv", "factor": 0.8, "since": None, "sure": 9.0, "beside": False}]
