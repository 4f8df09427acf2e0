"""Which mapping holds where the command line, `rig.toml`, a plant file and the log itself may have one."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from experiments.cli.reading import Reading, read
from furuta_gym.plant import QUBE
from identification.logs.rig_file import load_mapping, save_mapping
from identification.logs.rig_mapping import RigMapping
from tests.commands import furuta, refused, some_log
from tests.factories import loop_log


def test_options_win_over_the_file_and_none_reads_none(german: Path) -> None:
    furuta("init", "versuch1.csv")
    refused(furuta("validate", "qube", "versuch2.csv", "--unit", "rad"), "is read in rad", "--unit q2=deg")
    refused(furuta("validate", "qube", "versuch2.csv", "--mapping", "none"), "no column t, q1, q2, u")
    refused(furuta("validate", "qube", "versuch2.csv", "--mapping", "other.toml"), "other.toml", "furuta init LOG")
    refused(furuta("studio", "versuch2.csv", "--mapping", "other.toml"), "other.toml", "furuta init LOG")


def test_the_file_of_the_working_folder_serves_logs_elsewhere(german: Path) -> None:
    furuta("init", "versuch1.csv")
    (german / "more").mkdir()
    shutil.move("versuch2.csv", "more/versuch2.csv")
    result = furuta("validate", "qube", "more/versuch2.csv")
    assert result.exit_code == 0, result.output


def test_a_plant_file_carries_the_mapping(german: Path) -> None:
    furuta("init", "versuch1.csv")
    mapping = load_mapping("rig.toml")
    QUBE.replace(provenance={"mapping": mapping.to_dict()}).save("rig.json")
    Path("rig.toml").unlink()
    result = furuta("validate", "rig.json", "versuch2.csv")
    assert result.exit_code == 0, result.output
    assert "Read as the plant file says" in result.stderr


def test_a_plant_file_comes_before_the_folder_that_one_works_in(german: Path) -> None:
    """Beside the log is nearer than the plant file, and the plant file nearer than the working folder."""
    furuta("init", "versuch1.csv")
    mapping = load_mapping("rig.toml")
    QUBE.replace(provenance={"mapping": mapping.to_dict()}).save("rig.json")
    (german / "more").mkdir()
    shutil.move("versuch2.csv", "more/versuch2.csv")
    Path("rig.toml").write_text("a rig.toml that no command may read", encoding="utf-8")
    result = furuta("validate", "rig.json", "more/versuch2.csv")
    assert result.exit_code == 0, result.output
    assert "Read as the plant file says" in result.stderr
    shutil.move("rig.toml", "more/rig.toml")
    refused(furuta("validate", "rig.json", "more/versuch2.csv"), "not a TOML file")


def test_what_is_printed_reads_a_log_once_more_as_it_was_read(german: Path) -> None:
    """Where the plant file's mapping held, the working folder's would hold in a command without that plant."""
    furuta("init", "versuch1.csv")
    mapping = load_mapping("rig.toml")
    plant = QUBE.replace(provenance={"mapping": mapping.to_dict()})
    (german / "more").mkdir()
    shutil.move("versuch2.csv", "more/versuch2.csv")
    paths = [Path("more/versuch2.csv")]
    save_mapping("rig.toml", replace(mapping, input_scale=12.0))
    again = Reading(RigMapping()).again(paths, read(paths, Reading(RigMapping()), plant))
    assert again.endswith("--mapping none")
    assert mapping.options() in again
    assert Reading(RigMapping()).again(paths, read(paths, Reading(RigMapping()))) == ""


def test_options_hold_against_a_rig_file_that_turns_a_sign(german: Path) -> None:
    """A command line that turns none must say so, and the seconds left out too where they are none."""
    furuta("init", "versuch1.csv", "--skip", "1")
    said = RigMapping(flip=(), skip=0.0)
    assert said.options() == "--flip none --skip 0"
    logs = [replace(loop_log(duration=5.0)[0], mapping=said.over(load_mapping("rig.toml")))]
    assert Reading(said).again([Path("versuch1.csv")], logs) == " --flip none --skip 0"
    assert RigMapping().options() == ""


def test_a_rig_file_that_contradicts_the_plant_file_is_said(german: Path) -> None:
    """`rig.toml` holds; the warning names both and the way out, once. An option is meant, and is no contradiction."""
    furuta("init", "versuch1.csv")
    mapping = load_mapping("rig.toml")
    fitted = replace(mapping, input_scale=12.0, skip=0.5, flip=())
    QUBE.replace(provenance={"mapping": fitted.to_dict()}).save("rig.json")
    said = furuta("validate", "rig.json", "versuch1.csv", "versuch2.csv").stderr
    assert "versuch2.csv is read with --flip q2 --input-scale 1, as rig.toml says" in said
    assert "add --flip none --input-scale 12, or identify the plant again" in said
    assert said.count("versuch2.csv is read with") == 1
    meant = furuta("validate", "rig.json", "versuch2.csv", "--input-scale", "1", "--flip", "q2").stderr
    assert "The plant's own logs" not in meant


@pytest.mark.parametrize(
    "same",
    [{}, {"skip": 0.5}, {"input_unit": None}, {"u": "another column, which this log does not have"}],
    ids=["equal", "start", "left open", "another logger's column"],
)
def test_what_does_not_contradict_the_plant_file_is_not_said(german: Path, same: dict[str, object]) -> None:
    furuta("init", "versuch1.csv")
    fitted = replace(load_mapping("rig.toml"), **same)  # type: ignore[arg-type]
    QUBE.replace(provenance={"mapping": fitted.to_dict()}).save("rig.json")
    result = furuta("validate", "rig.json", "versuch2.csv")
    assert result.exit_code == 0, result.output
    assert "Warning" not in result.stderr


def test_an_identified_plant_carries_it(german: Path) -> None:
    furuta("init", "versuch1.csv")
    result = furuta("identify", "versuch1.csv", "-o", "rig.json", "--method", "filtered-ls")
    assert result.exit_code == 0, result.output
    assert "u_max = 1.2 V (largest command 1.2, where the commands stop); set it with --u-max" in result.stdout
    assert "or give its value: --fix theta" in result.stdout
    assert "fix it" not in result.stdout
    assert "fix them" not in result.stdout
    Path("rig.toml").unlink()
    assert furuta("validate", "rig.json", "versuch2.csv").exit_code == 0


def test_a_log_of_the_project_beside_a_rig_file_is_read_by_its_own_names(german: Path) -> None:
    furuta("init", "versuch1.csv")
    furuta("simulate", "--plant", "qube", "--excitation", "chirp", "--duration", "4", "-o", "sim.csv")
    result = furuta("validate", "qube", "sim.csv")
    assert result.exit_code == 0, result.output
    assert "read by its own t, q1, q2, u" in result.stderr


def test_logs_of_one_file_name_are_called_by_their_folders_too(tmp_path: Path) -> None:
    paths = [tmp_path / day / "log.csv" for day in ("monday", "tuesday")]
    for path in paths:
        path.parent.mkdir()
        some_log(path)
    other, said = some_log(tmp_path / "other.csv"), Reading(RigMapping())
    assert [log.source for log in read([*paths, other], said)] == ["monday/log.csv", "tuesday/log.csv", "other.csv"]
    assert [log.source for log in read(paths[:1], said, beside=paths[1:])] == ["monday/log.csv"]
    assert [log.source for log in read(paths[:1], said, beside=[other])] == ["log.csv"]


def test_what_an_option_says_is_not_called_the_files(german: Path) -> None:
    furuta("init", "versuch1.csv")
    said = furuta("validate", "qube", "versuch1.csv", "--columns", "u=nope", "--input-scale", "2").stderr
    (line,) = [line for line in said.splitlines() if line.startswith("Read as ")]
    of_file, _, of_options = line.removeprefix("Read as rig.toml says: ").partition("; as the options say: ")
    assert of_options == "--columns u=nope --input-scale 2"
    assert "Pendel" in of_file
    assert "--unit deg" in of_file
    assert "nope" not in of_file
    assert "--input-scale" not in of_file


def test_logs_of_two_formats_need_a_rig_file_each_which_is_said(tmp_path: Path) -> None:
    """And with one each they are read together."""
    names = {"ours": ("t,q1,q2,u [V]", 1.0), "theirs": ("Time,theta [deg],alpha [deg],volts [V]", 180 / np.pi)}
    logs = []
    for i, (name, (header, size)) in enumerate(names.items()):
        log = loop_log(duration=5.0, T=0.004, seed=i)[0]
        (tmp_path / name).mkdir()
        logs.append(tmp_path / name / f"{name}.csv")
        table = np.column_stack([log.t, size * log.q1, size * log.q2, log.u])
        np.savetxt(logs[-1], table, delimiter=",", header=header, comments="")
    looked = furuta("init", *logs)
    assert looked.exit_code == 2
    assert "need a rig.toml each: put them into folders of their own, run `furuta init` on each" in looked.stderr
    refused(furuta("validate", "table3", *logs), "need a rig.toml each")
    for path in logs:
        assert furuta("init", path, "--yes").exit_code == 0
    result = furuta("validate", "table3", *logs)
    assert result.exit_code == 0, result.output
    assert "theirs/rig.toml says: --columns 't=Time" in result.stderr


def test_logs_in_two_units_under_the_same_names_need_a_rig_file_each(tmp_path: Path) -> None:
    logs = []
    for i, size in enumerate((1.0, 180 / np.pi)):
        log = loop_log(duration=5.0, T=0.004, seed=i)[0]
        table = np.column_stack([log.t, size * log.q1, size * log.q2, log.u])
        logs.append(tmp_path / f"log{i}.csv")
        np.savetxt(logs[-1], table, delimiter=",", header="t,q1,q2,u [V]", comments="")
    looked = furuta("init", *logs)
    assert looked.exit_code == 2
    assert "q2 is in rad in log0.csv, in deg in log1.csv. Logs that are written in different ways" in looked.stderr
    assert not (tmp_path / "rig.toml").exists()
