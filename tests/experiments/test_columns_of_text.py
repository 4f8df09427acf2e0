"""What a command says of a column that holds text, or of a command that is constant."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.commands import furuta, refused, some_log
from tests.factories import paper_log


@pytest.mark.parametrize("rows", [slice(50, 51), slice(0, None), slice(0, None, 2)], ids=["one", "all", "half"])
def test_a_command_that_is_text_is_named_with_its_place(tmp_path: Path, rows: slice) -> None:
    u = np.ones(400).astype(object)
    u[rows] = "abc"
    result = furuta("init", some_log(tmp_path / "log.csv", u=u))
    assert result.exit_code == 2
    assert f"the text 'abc' in column u at line {2 + (rows.start or 0)}. Expected a number." in result.stderr
    assert "no column is known" not in result.stderr
    assert not (tmp_path / "rig.toml").exists()


def test_a_column_without_a_telling_name_that_was_left_out_for_its_text_is_named(tmp_path: Path) -> None:
    u = np.ones(400).astype(object)
    u[50] = "abc"
    path = some_log(tmp_path / "log.csv", u=u)
    path.write_text(path.read_text().replace("t,q1,q2,u", "t,q1,q2,d"))
    result = furuta("init", path)
    assert result.exit_code == 2
    assert "no column is known to be command (u)" in result.stderr
    assert "the text 'abc' in column d at line 52" in result.stderr


def test_the_hint_to_read_as_given_knows_that_a_constant_command_may_be(tmp_path: Path) -> None:
    """`validate` takes a log of a free decay, so --as-given reads this one, whose unit is wrong."""
    log, _ = paper_log()
    table = {"t": log.t, "q1": np.rad2deg(log.q1), "q2": np.rad2deg(log.q2), "u": 0 * log.u}
    path = some_log(tmp_path / "log.csv", **table)
    result = furuta("validate", "table3", path)
    refused(result, "deg", "with --as-given")
