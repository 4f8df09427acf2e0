"""`furuta residuals` shows where a model fails and names nothing."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from furuta_gym.plant import EFFECTS, TABLE_3
from identification import write_log
from tests.commands import furuta, refused
from tests.factories import loop_log


def test_what_pulls_the_arm_is_seen_as_a_slope_and_not_named(tmp_path: Path) -> None:
    log, plant = loop_log("arm_spring", 2.0, T=0.004, duration=6.0)
    write_log(tmp_path / "log.csv", log)
    TABLE_3.save(tmp_path / "rig.json")
    result = furuta("residuals", tmp_path / "log.csv", "--plant", tmp_path / "rig.json", "-o", tmp_path / "out")
    assert result.exit_code == 0, result.output
    assert not [name for name in EFFECTS if name in result.output]
    assert not [word for word in ("spring", "cable", "delay", "friction") if word in result.stdout]
    found = json.loads((tmp_path / "out" / "residuals.json").read_text())
    (arm,) = [m for m in found["maps"] if (m["row"], m["variable"]) == ("arm", "arm angle")]
    middle = 0.5 * (np.array(arm["edges"][1:]) + np.array(arm["edges"][:-1]))
    slope = np.polyfit(middle, arm["mean"], 1, w=1 / np.array(arm["std"]))[0]
    spring = plant.effect("arm_spring")
    assert spring is not None
    assert abs(slope / -spring.parameters["k"] - 1) < 0.5
    assert found["missing_torque_rms"]["arm"] > 10 * found["missing_torque_rms"]["pendulum"]
    assert (tmp_path / "out" / "residuals.png").read_bytes().startswith(b"\x89PNG")
    assert "spring" not in (tmp_path / "out" / "residuals.json").read_text()


def test_zeros_of_the_encoders_are_no_missing_torque(tmp_path: Path) -> None:
    """A log that another day's encoders wrote is shown as one of the plant's own zeros."""
    log, plant = loop_log("arm_spring", 2.0, T=0.004, duration=6.0)
    plant.save(tmp_path / "rig.json")
    write_log(tmp_path / "off.csv", log.moved(-0.3, -0.002))
    result = furuta("residuals", tmp_path / "off.csv", "--plant", tmp_path / "rig.json", "--json")
    missing = json.loads(result.stdout)["missing_torque_rms"]
    spring = plant.effect("arm_spring")
    assert spring is not None
    assert missing["arm"] < 1e-3 * 0.3 * spring.parameters["k"]  # of the torque that the zero would add
    assert missing["pendulum"] < 1e-3 * 0.002 * plant.theta[4]


def test_a_plant_that_is_none_is_refused_before_the_log_is_read(tmp_path: Path) -> None:
    refused(furuta("residuals", tmp_path / "absent.csv", "--plant", "nothing"), "no plant 'nothing'")
