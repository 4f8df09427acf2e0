"""`furuta score`: figures of runs, read as every log of a rig is read."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from controllers import make_controller
from furuta_gym.plant import QUBE
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import LivePlant
from identification.logs.log import Log, write_log
from tests.commands import furuta, refused

T = 0.004


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """A run of 4 s that is held, at an arm of 0.1 rad, and one whose motor is switched off after 1 s."""
    folder, paths = tmp_path_factory.mktemp("runs"), []
    for name, off in (("held.csv", 9.0), ("fell.csv", 1.0)):
        rig, rows = LivePlant(QUBE, T, Sensors(2048), x0=(0.1, 0.02, 0.0, 0.0)), []
        controller = make_controller("lqr", QUBE, T, reference=0.1)
        controller.reset()
        while rig.t < 4.0:
            y = rig.read()
            u = controller(y) if rig.t < off else 0.0
            rows.append((rig.t, *y, u))
            rig.step(u)
        t, q1, q2, u = np.array(rows).T
        paths.append(folder / name)
        write_log(paths[-1], Log(t, q1, q2, u, input_unit="V", encoder_counts=(2048, 2048)))
    return paths


def test_every_run_has_its_figures(runs: list[Path]) -> None:
    result = furuta("score", *runs, "--json")
    assert result.exit_code == 0, result.output
    told = json.loads(result.stdout)
    held, fell = told["runs"]
    assert (held["log"], fell["log"]) == ("held.csv", "fell.csv")
    assert held["success"]
    assert held["failed_at"] is None
    assert held["mean_q1"] == pytest.approx(0.1, abs=0.02)
    assert held["settling"] < 1.0
    assert 1.0 < fell["failed_at"] < 2.0
    assert fell["settling"] is None
    assert told["unit"] == "V"


def test_the_table_names_each_run(runs: list[Path]) -> None:
    result = furuta("score", *runs)
    assert result.exit_code == 0, result.output
    assert "held.csv" in result.stdout
    assert "to the end" in result.stdout
    assert "[rad]" in result.stdout


def test_what_is_no_run_is_refused(runs: list[Path], tmp_path: Path) -> None:
    refused(furuta("score", runs[0], "--swing-up"), "held.csv: the run lasts 4")
    refused(furuta("score", runs[0], "--arm-travel", "-1"), "--arm-travel -1")
    refused(furuta("score", tmp_path / "absent.csv"), "absent.csv")


def test_the_arm_s_travel_is_the_plant_file_s(runs: list[Path], tmp_path: Path) -> None:
    """Unless --arm-travel says another; a plant file without one leaves 2π."""
    tight, free = (
        QUBE.replace(limits=limits).save(tmp_path / f"{name}.json")
        for name, limits in (("tight", {"arm_travel": 0.09}), ("free", None))
    )
    scored = lambda *words: json.loads(furuta("score", runs[0], *words, "--json").stdout)["runs"][0]["success"]  # noqa: E731
    assert not scored("--plant", tight)
    assert scored("--plant", tight, "--arm-travel", 1.0)
    assert scored("--plant", free)
    refused(furuta("score", runs[0], "--plant", tmp_path / "absent.json"), "absent.json")


def test_a_run_whose_arm_is_faster_than_the_plant_file_says_has_failed(runs: list[Path], tmp_path: Path) -> None:
    for speed, success, why in ((0.01, False, "speed"), (100.0, True, None)):
        plant = QUBE.replace(limits={"arm_speed": speed}).save(tmp_path / "rig.json")
        told = json.loads(furuta("score", runs[0], "--plant", plant, "--json").stdout)
        assert [(run["success"], run["why"]) for run in told["runs"]] == [(success, why)]


def test_a_run_that_begins_hanging_is_told_of_swing_up(runs: list[Path], tmp_path: Path) -> None:
    """Scored as balancing it has held for no time at all."""
    rig, rows = LivePlant(QUBE, T, Sensors(2048), x0=(0.0, np.pi, 0.0, 0.0)), []
    controller = make_controller("swing-up", QUBE, T)
    while rig.t < 8.0:
        y = rig.read()
        u = controller(y)
        rows.append((rig.t, *y, u))
        rig.step(u)
    t, q1, q2, u = np.array(rows).T
    write_log(tmp_path / "up.csv", Log(t, q1, q2, u, input_unit="V", encoder_counts=(2048, 2048)))
    told = furuta("score", runs[0], tmp_path / "up.csv")
    assert told.exit_code == 0, told.output
    assert "Note: up.csv begins hanging. Give --swing-up" in told.stdout
    assert "begins hanging" not in furuta("score", tmp_path / "up.csv", "--swing-up").stdout
    assert "begins hanging" not in furuta("score", runs[0]).stdout
