"""Files that are no log at all: what is missing is named before anything is computed."""

from __future__ import annotations

import pytest

from identification.logs.formats import read_table
from identification.logs.log import LogError, read_log
from identification.logs.proposal import propose
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
