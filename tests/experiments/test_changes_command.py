"""`furuta changes`: two plant files of one rig."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from furuta_gym.plant import TABLE_3, THETA_NAMES
from furuta_gym.plant.covariance import Covariance
from tests.commands import furuta, refused


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    """Plant files with errors of one per cent; in the second one θ6 is 20 % larger."""
    covariance = Covariance(THETA_NAMES, np.diag((0.01 * TABLE_3.theta) ** 2))
    before = TABLE_3.replace(covariance=covariance)
    after = before.replace(theta=TABLE_3.theta * np.where(np.arange(9) == 5, 1.2, 1.0))
    return before.save(tmp_path / "before.json"), after.save(tmp_path / "after.json")


def test_what_changed_is_marked_and_told(files: tuple[Path, Path]) -> None:
    result = furuta("changes", *files)
    assert result.exit_code == 0, result.output
    marked = [line for line in result.stdout.splitlines() if "!" in line and "θ" in line]
    assert len(marked) == 1
    assert "θ6 [V·s/rad]" in marked[0]
    assert "+20.0 %" in marked[0]
    assert "Differs by more than 3 standard deviations: θ6 +20 %" in result.stdout


def test_nothing_is_told_of_the_same_parameters(files: tuple[Path, Path]) -> None:
    result = furuta("changes", files[0], files[0])
    assert "No change shows" in result.stdout
    assert result.exit_code == 0


def test_json_says_the_same(files: tuple[Path, Path]) -> None:
    told = json.loads(furuta("changes", *files, "--json").stdout)
    assert told["changed"] is True
    assert [name for name, p in told["parameters"].items() if p["certain"]] == ["theta6"]
    assert told["parameters"]["theta6"]["factor"] == pytest.approx(1.2)


def test_a_rig_over_weeks(files: tuple[Path, Path], tmp_path: Path) -> None:
    """Each later file is compared with the first one."""
    week = Path(shutil.copy(files[0], tmp_path / "week3.json"))
    result = furuta("changes", files[0], files[1], week)
    assert result.exit_code == 0, result.output
    (row,) = [line for line in result.stdout.splitlines() if "θ6" in line and "│" in line]
    assert row.count("!") == 1
    assert "+20.00 ± 1.6 % !" in row
    assert "+0.00 ± 1.4 %" in row
    assert "after.json: Differs by more than 3 standard deviations: θ6 +20 %" in result.stdout
    assert "week3.json: No change shows" in result.stdout
    told = json.loads(furuta("changes", files[0], files[1], week, "--json").stdout)
    assert [entry["changed"] for entry in told["changes"]] == [True, False]
    assert [Path(entry["after"]).name for entry in told["changes"]] == ["after.json", "week3.json"]


def test_a_plant_moved_by_hand_and_one_without_error_bars(files: tuple[Path, Path], tmp_path: Path) -> None:
    data = json.loads(files[0].read_text())
    data["provenance"] = {"moved": {"theta6": 0.1}}
    files[0].write_text(json.dumps(data))
    assert "before.json: was moved by hand" in furuta("changes", *files).stderr
    data["provenance"], data["checks"] = {}, {"converged": False, "at_bound": ["theta6"]}
    files[0].write_text(json.dumps(data))
    told = furuta("changes", *files, "--json")
    assert "its fit did not converge" in told.stderr
    assert "theta6" in json.loads(told.stdout)["not_judged"]
    bare = TABLE_3.save(tmp_path / "bare.json")
    refused(furuta("changes", files[1], bare), "bare.json: a plant has no error bars; expected a plant file as")
    refused(furuta("changes", files[1], tmp_path / "none.json"), "no plant file at")
