"""`furuta simulate`: what a controller that was designed from another plant is played at."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from furuta_gym.plant import QUBE
from identification import read_log
from tests.commands import furuta, refused


def test_a_design_plant_of_another_unit_is_refused(tmp_path: Path) -> None:
    words = ("--controller", "lqr", "--design-plant", "large", "-o", tmp_path / "log.csv")
    refused(furuta("simulate", "--plant", "qube", *words), "design plant's command is in N·m", "the plant's in V")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("own", [0.005, None])
def test_a_design_is_played_on_the_rig_s_clock(own: float | None, tmp_path: Path) -> None:
    rig = QUBE.replace(sample_time=own).save(tmp_path / "rig.json")
    log = tmp_path / "log.csv"
    words = ("--controller", "lqr", "--design-plant", "qube", "--duration", 0.5, "-o", log)
    result = furuta("simulate", "--plant", rig, *words)
    assert result.exit_code == 0, result.output
    assert np.diff(read_log(log).t) == pytest.approx(own or 0.002)


@pytest.mark.parametrize("words", [("--amplitude", 3), ("--design-plant", "qube"), ("--trust",)])
def test_what_scales_no_excitation_or_is_of_no_controller_is_refused(words: tuple[object, ...], tmp_path: Path) -> None:
    use = "--excitation" if words[0] == "--amplitude" else "--controller"
    refused(furuta("simulate", "--plant", "qube", *words, "-o", tmp_path / "log.csv"), str(words[0]), f"with {use}")
    assert list(tmp_path.iterdir()) == []


def test_limits_of_the_plant_that_the_arm_passes_are_told(tmp_path: Path) -> None:
    words = ("--excitation", "paper", "--duration", 4, "--json")
    told = {}
    for name, limits in (("none", None), ("wide", {"arm_travel": 50.0}), ("tight", {"arm_travel": 0.05})):
        rig = QUBE.replace(limits=limits).save(tmp_path / f"{name}.json")
        told[name] = furuta("simulate", "--plant", rig, *words, "-o", tmp_path / "log.csv")
        assert told[name].exit_code == 0, told[name].output
    assert json.loads(told["none"].stdout)["limits_passed_at_s"] == {}
    assert "Warning" not in told["wide"].stderr
    passed = json.loads(told["tight"].stdout)["limits_passed_at_s"]["arm_travel"]
    log = read_log(tmp_path / "log.csv")
    assert abs(log.q1[log.t < passed - 0.01]).max() < 0.06
    assert abs(log.q1[log.t < passed + 0.02]).max() > 0.04
    assert f"passes limits.arm_travel of the plant at t = {passed:.3f} s" in told["tight"].stderr
