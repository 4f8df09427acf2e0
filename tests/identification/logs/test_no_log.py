"""Files that are no log at all: what is missing is named before anything is computed."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest

from furuta_gym import simulate
from furuta_gym.plant import QUBE
from furuta_gym.simulation import open_loop
from identification import diagnose, identify, validate
from identification.diagnosis.locate.locate import locate
from identification.logs.formats import read_table
from identification.logs.log import LogError
from identification.logs.proposal import propose
from identification.logs.reading import read_log
from tests.factories import made_log
from tests.files import csv, rows


def test_a_header_without_rows_is_named(tmp_path):
    (tmp_path / "log.csv").write_text("t,q1,q2,u\n")
    with pytest.raises(LogError, match=r"log\.csv: 0 samples. There is a header, and no row below it"):
        read_table(tmp_path / "log.csv")


@pytest.mark.parametrize("column", ["q1", "q2", "u"])
def test_a_number_beyond_any_measurement_is_named_before_anything_is_computed_of_it(tmp_path, column, capfd):
    """Its square is infinite, and the linear algebra then fails without the name of the file."""
    table = read_table(csv(tmp_path, rows(400), **{column: [*rows(400)[column][:-1].tolist(), 1e300]}))
    assert any("1e+300" in str(problem) and column in str(problem) for problem in propose(table).fatal)
    assert "illegal value" not in "".join(capfd.readouterr())


def test_a_folder_lists_what_is_in_it(tmp_path):
    (tmp_path / "runs.csv").mkdir()
    csv(tmp_path / "runs.csv")
    csv(tmp_path)
    with pytest.raises(LogError, match=r"is a folder.*In that folder: log\.csv\.$") as told:
        read_log(tmp_path / "runs.csv")
    assert "runs.csv," not in str(told.value)


@pytest.mark.parametrize("given", ["log.csv", Path("log.csv"), ["log.csv"]])
@pytest.mark.parametrize("use", [identify, diagnose, partial(validate, "qube"), partial(locate, QUBE)])
def test_the_name_of_a_file_is_no_log(use, given):
    with pytest.raises(TypeError, match=r"expected a Log, got 'log.csv'; read the file first: read_log\('log.csv'\)"):
        use(given)
    with pytest.raises(TypeError, match="expected a Log"):
        diagnose(made_log(), "held_out.csv")


def test_plants_go_by_name_or_file(tmp_path):
    by_value, by_name = (simulate(plant, open_loop(), 0.1, x0=(0, 3, 0, 0)) for plant in (QUBE, "qube"))
    by_file = simulate(str(QUBE.save(tmp_path / "rig.json")), open_loop(), 0.1, x0=(0, 3, 0, 0))
    for other in (by_name, by_file):
        np.testing.assert_array_equal(by_value.state, other.state)
    with pytest.raises(FileNotFoundError, match=r"no plant 'none\.json'"):
        simulate("none.json", open_loop(), 0.1)
