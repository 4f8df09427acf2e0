"""`furuta init` on logs that do not say all, and over a rig.toml that says more than a log can."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from identification import read_log
from identification.logs.rig_file import load_mapping, save_mapping
from identification.logs.rig_mapping import RigMapping
from tests.commands import furuta, refused
from tests.experiments.test_init import rows, write


def test_yes_keeps_the_scale_and_what_is_left_out(tmp_path: Path) -> None:
    log, rig = write(tmp_path / "log.csv", rows()), tmp_path / "rig.toml"
    assert furuta("init", log, "--input-unit", "N·m", "--input-scale", "0.5", "--skip", "1").exit_code == 0
    again = furuta("init", log, "--yes")
    assert again.exit_code == 0
    assert "Kept from" in again.stderr
    kept = load_mapping(rig)
    assert (kept.input_unit, kept.input_scale, kept.skip) == ("N·m", 0.5, 1.0)
    assert "# kept from the file that was here" in rig.read_text(encoding="utf-8")
    save_mapping(tmp_path / "other.toml", RigMapping(skip=2.0))
    for mapping, skip in (("none", None), (tmp_path / "other.toml", 2.0)):
        alone = furuta("init", log, "--yes", "--mapping", mapping)
        assert (alone.exit_code, load_mapping(rig).input_scale, load_mapping(rig).skip) == (0, None, skip)
        assert "Kept" not in alone.stderr
        save_mapping(rig, kept)
    said = furuta("init", log, "--yes", "--skip", "0", "--input-scale", "2", "--input-unit", "N·m")
    assert said.exit_code == 0
    assert "Kept" not in said.stderr
    assert (load_mapping(rig).input_scale, load_mapping(rig).skip or 0.0) == (2.0, 0.0)
    assert furuta("init", log, "--yes", "--input-unit", "V").exit_code == 0
    assert (load_mapping(rig).input_unit, load_mapping(rig).input_scale) == ("V", None)
    other = write(tmp_path / "other.csv", {"t": rows()["t"], "q1": rows()["q1"], "q2": rows()["q2"], "Vm": rows()["u"]})
    save_mapping(rig, RigMapping(u="u", input_unit="N·m", input_scale=0.5, time_unit="0.5"))
    assert furuta("init", other, "--yes", "-o", str(rig), "--time-unit", "s").exit_code == 0
    assert (load_mapping(rig).input_unit, load_mapping(rig).input_scale) == ("V", None)
    rig.write_text("no TOML [")
    assert furuta("init", log, "--yes").exit_code == 0


def test_columns_that_are_said_are_read_as_given(tmp_path: Path) -> None:
    table = rows()
    log = write(tmp_path / "log.csv", table | {"q1": table["q2"], "q2": table["q1"]}, "# input_unit: V")
    said = ("--columns", "t=t,q1=q1,q2=q2,u=u", "--pendulum-zero", "hanging", "--flip", "none")
    assert "swapped" in furuta("init", log, *said).stderr
    assert furuta("init", log, *said, "--as-given").exit_code == 0


def test_a_counter_of_samples_asks_for_its_seconds(tmp_path: Path) -> None:
    table = rows()
    counted = {"sample": np.arange(len(table["t"]))} | {name: table[name] for name in ("q1", "q2", "u")}
    log = write(tmp_path / "log.csv", counted, "# input_unit: V")
    asked = furuta("init", log)
    assert asked.exit_code == 2
    assert "--time-unit SECONDS" in asked.stderr
    assert "The motion may tell the rest then" in asked.stderr
    refused(furuta("init", log, "--time-unit", "-1"), "the seconds of one count")
    T = float(table["t"][1] - table["t"][0])
    assert furuta("init", log, "--time-unit", f"{T:g}").exit_code == 0
    assert np.allclose(read_log(log, **load_mapping(tmp_path / "rig.toml").arguments()).t, table["t"] - table["t"][0])
