"""Files and settings of a first hour that once ended in a traceback or a wrong number."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from experiments.cli import app
from furuta_gym.files import write_whole
from identification.logs.checks import LogWarning
from identification.logs.gaps import longest_spacing
from identification.logs.log import Log
from identification.logs.reading import LogError, read_log
from identification.logs.rig_file import load_mapping
from identification.logs.said import parse_flip, parse_unit
from identification.logs.vocabulary import unit_in
from tests.factories import loop_log

pytestmark = pytest.mark.filterwarnings("ignore::identification.logs.checks.LogWarning")


@pytest.fixture(scope="module")
def log() -> Log:
    return loop_log(duration=4.0, T=0.004)[0]


def written(folder: Path, t: np.ndarray, q1: np.ndarray, log: Log) -> Path:
    rows = np.column_stack([t, q1, log.q2, log.u])
    np.savetxt(folder / "log.csv", rows, delimiter=",", header="t,q1,q2,u", comments="", fmt="%.12g")
    return folder / "log.csv"


@pytest.mark.parametrize("digits", [0, 1, 2])
def test_stamps_of_too_few_digits_are_told(tmp_path: Path, log: Log, digits: int) -> None:
    path = written(tmp_path, np.round(log.t, digits), log.q1, log)
    for command in (["init", "--yes"], ["identify", "--input-unit", "V", "-o", str(tmp_path / "rig.json")]):
        result = CliRunner().invoke(app, [command[0], str(path), *command[1:]])
        assert result.exit_code == 2
        assert "time stands still" in result.stderr
        assert "samples are missing" not in result.stderr
    assert longest_spacing(np.zeros(9)) == math.inf


def test_a_clock_that_counts_has_whole_numbers(tmp_path: Path, log: Log) -> None:
    """0.5 in place of 0.005: every θ would have been wrong, with no word about it."""
    path = written(tmp_path, log.t, log.q1, log)
    for command in (["init", "--yes"], ["identify", "--input-unit", "V", "-o", str(tmp_path / "rig.json")]):
        result = CliRunner().invoke(app, [command[0], str(path), *command[1:], "--time-unit", "0.5"])
        assert result.exit_code == 2
        assert "its numbers are not whole" in result.stderr
    counted = written(tmp_path, np.round(log.t / 0.004), log.q1, log)
    assert read_log(counted, time_unit="0.004", input_unit="V").sample_time == pytest.approx(0.004)


def test_a_wrapped_arm_begins_within_half_a_turn(tmp_path: Path, log: Log) -> None:
    """A counter modulo a turn that starts just below zero is no arm that starts a turn away."""
    turn = 2.0 * np.pi
    q1 = log.q1 - log.q1[0] - 0.01
    read = read_log(written(tmp_path, log.t, q1 % turn, log), input_unit="V")
    np.testing.assert_allclose(read.q1, q1, atol=1e-6)


@pytest.mark.parametrize("flip", [True, 2, [["q2"]]])
def test_signs_of_another_type_are_refused(flip: object) -> None:
    with pytest.raises(LogError, match="expected a list of q1, q2, u"):
        parse_flip(flip)  # type: ignore[arg-type]


def test_a_unit_that_is_no_text_is_refused() -> None:
    with pytest.raises(LogError, match="expected V or N·m"):
        parse_unit(5)  # type: ignore[arg-type]


def test_a_name_that_is_no_utf8_loses_no_file(tmp_path: Path) -> None:
    write_whole(tmp_path / "a.json", '{"source": "l\udce4.csv"}')
    assert (tmp_path / "a.json").read_text() == '{"source": "l\\udce4.csv"}'


def test_millivolts_beside_volts_are_told_before_a_fit(tmp_path: Path) -> None:
    for i, scale in enumerate((1.0, 1000.0)):
        log = loop_log(duration=5.0, T=0.004, seed=i)[0]
        rows = np.column_stack([log.t, log.q1, log.q2, scale * log.u])
        np.savetxt(tmp_path / f"log{i}.csv", rows, delimiter=",", header="t,q1,q2,u", comments="", fmt="%.9g")
    logs = [str(tmp_path / f"log{i}.csv") for i in (0, 1)]
    result = CliRunner().invoke(app, ["validate", "table3", *logs, "--input-unit", "V"])
    assert "Warning: the command of log1.csv does 0.0009" in result.stderr
    assert "does" not in CliRunner().invoke(app, ["validate", "table3", logs[0], "--input-unit", "V"]).stderr


@pytest.mark.parametrize("counts", [2048, 4096])
@pytest.mark.parametrize("zero", ["upright", "hanging"])
def test_angles_in_turns_are_read_in_turns(tmp_path: Path, zero: str, counts: int) -> None:
    """As drives for brushless motors give them. In rad, they would be a sixth of a motion, and fit no less well."""
    log = loop_log(duration=4.0, T=0.004, counts=counts)[0]
    turns = replace(log, q1=log.q1 / math.tau, q2=(log.q2 + (math.pi if zero == "hanging" else 0.0)) / math.tau)
    path = written(tmp_path, log.t, turns.q1, turns)
    with pytest.warns(LogWarning, match=f"steps of 1/{counts}, which looks like turns"):
        read_log(path, input_unit="V", pendulum_zero=zero)
    read = read_log(path, unit="turns", input_unit="V", pendulum_zero=zero, encoder_counts=counts)
    np.testing.assert_allclose(read.angles, log.angles, atol=1e-9)
    result = CliRunner().invoke(app, ["init", str(path), "--yes", "-o", str(tmp_path / "rig.toml")])
    assert result.exit_code == 0, result.stderr
    assert 'q1 = "turns"' in (tmp_path / "rig.toml").read_text()
    np.testing.assert_allclose(
        read_log(path, **load_mapping(tmp_path / "rig.toml").arguments()).angles, log.angles, atol=1e-9
    )


@pytest.mark.parametrize("name", ["q1 [turns]", "arm_rev", "arm / U"])
def test_a_name_may_say_turns(name: str) -> None:
    assert unit_in(name) == ("turns" if name != "arm / U" else None)


def test_radians_are_not_taken_for_turns(tmp_path: Path) -> None:
    """Nor an encoder behind a gear, whose counts are of no usual one either way."""
    for counts in (2048, 7168):
        log = loop_log(duration=4.0, T=0.004, counts=counts)[0]
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            read_log(written(tmp_path, log.t, log.q1, log), input_unit="V")
        assert not any("turns" in str(one.message) for one in caught)
        with pytest.warns(LogWarning, match="if it were turns"):
            read_log(
                written(tmp_path, log.t, np.rad2deg(log.q1), log), input_unit="V", unit={"q1": "turns", "q2": "rad"}
            )


def test_turns_that_the_file_states_are_believed_behind_a_gear(tmp_path: Path) -> None:
    log = loop_log(duration=4.0, T=0.004, counts=7168)[0]
    rows = np.column_stack([log.t, log.q1 / math.tau, log.q2 / math.tau, log.u])
    path = tmp_path / "log.csv"
    np.savetxt(path, rows, delimiter=",", header="t,arm [turns],pendulum [turns],voltage", comments="", fmt="%.12g")
    result = CliRunner().invoke(app, ["init", str(path), "--yes", "-o", str(tmp_path / "rig.toml")])
    assert result.exit_code == 0, result.stderr
    assert (tmp_path / "rig.toml").read_text().count('"turns"') == 2
