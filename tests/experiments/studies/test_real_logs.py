"""The study of measured logs: what it says of McGill's rig, and a folder without logs."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import typer
from typer.testing import CliRunner

from experiments.studies.real_logs import RIGS, main, report, study, to_json
from identification.validation.gap import Gap


def test_a_measured_rig_is_fitted_and_told_to_be_incomplete(real_data: Path) -> None:
    mcgill = next(rig for rig in RIGS if rig.folder == "qube_mcgill")
    found = study(real_data, replace(mcgill, held_out={"another run": mcgill.held_out["another run"]}), look=False)
    # independent fits of such rigs saw θ1 near 0.058 and arm Coulomb friction of 0.07 to 0.14 V
    assert 0.045 < found.estimate.value("theta1") < 0.07
    assert 0.04 < found.estimate.value("theta8") < 0.16
    gap = found.gaps["another run"]
    assert isinstance(gap, Gap)
    text = report([found])
    assert "torque noise fitted to these logs" in text
    assert "θ7" in text
    assert to_json([found])["rigs"][0]["held_out"]["another run"]["rms_q1"] == float(gap.rms[0])
    no_gap: Any = SimpleNamespace(to_dict=lambda: {"by_log": [{"closed_fraction": math.nan}]})
    data = to_json([replace(found, diagnosis=no_gap)])
    assert json.loads(json.dumps(data, allow_nan=False))["rigs"][0]["diagnosis"] == {
        "by_log": [{"closed_fraction": None}]
    }


def test_a_folder_without_logs_is_a_sentence(tmp_path: Path) -> None:
    app = typer.Typer()
    app.command()(main)
    result = CliRunner().invoke(app, [str(tmp_path), "-o", str(tmp_path / "out")])
    assert result.exit_code == 2
    assert "qube_darmstadt" in result.stderr
    assert not (tmp_path / "out").exists()
