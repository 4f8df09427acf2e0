"""Files and settings of a first hour that once ended in a traceback or a wrong number."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from experiments.cli import app
from furuta_gym.files import write_whole
from identification.logs.gaps import longest_spacing
from identification.logs.log import Log
from identification.logs.reading import LogError, read_log
from identification.logs.said import parse_flip, parse_unit
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
