"""A format of one's own, registered by the ending of its files, and the start of a log left out."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from experiments.cli.app import app
from identification import LogError, read_log, read_logs, write_log
from identification.logs import formats
from tests.factories import paper_log


def read_rows(path: Path) -> formats.Table:
    """A toy format: one line for each column, its name first."""
    lines = [line.split() for line in path.read_text(encoding="utf-8").splitlines()]
    return formats.Table(path.name, {name: np.array(values, dtype=float) for name, *values in lines})


def write_rows(path: Path, columns: Mapping[str, np.ndarray], metadata: Mapping[str, str]) -> None:
    path.write_text("\n".join(" ".join([n, *map(repr, c.tolist())]) for n, c in columns.items()), encoding="utf-8")


@pytest.fixture(autouse=True)
def _restored(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(formats, "READERS", dict(formats.READERS))
    monkeypatch.setattr(formats, "WRITERS", dict(formats.WRITERS))


def test_a_registered_format_is_read_written_and_known_to_the_commands(tmp_path: Path) -> None:
    log = paper_log(T=0.005, duration=3.0)[0]
    with pytest.raises(LogError, match="unknown ending"):
        read_log(tmp_path / "log.rows")
    formats.register(".rows", read_rows, write_rows)
    write_log(tmp_path / "log.rows", log)
    back = read_log(tmp_path / "log.rows")
    assert np.array_equal(back.angles, log.angles)
    assert np.array_equal(back.u, log.u)
    arguments = ["--plant", "table3", "--controller", "lqr", "--excitation", "paper", "--duration", "2"]
    result = CliRunner().invoke(app, ["simulate", *arguments, "-o", str(tmp_path / "simulated.rows")])
    assert result.exit_code == 0, result.output
    assert len(read_log(tmp_path / "simulated.rows")) == 1000


def test_a_format_without_a_writer_is_read_only(tmp_path: Path) -> None:
    formats.register(".rows", read_rows)
    with pytest.raises(LogError, match="cannot write"):
        write_log(tmp_path / "log.rows", paper_log(T=0.005, duration=3.0)[0])


@pytest.mark.parametrize(("ending", "word"), [("rows", "a dot"), (".ROWS", "small"), (".csv", "taken")])
def test_an_ending_that_cannot_be_is_refused(ending: str, word: str) -> None:
    with pytest.raises(ValueError, match=word):
        formats.register(ending, read_rows)


def test_the_start_of_a_log_can_be_left_out(tmp_path: Path) -> None:
    log = paper_log(T=0.005, duration=3.0)[0]
    write_log(tmp_path / "log.csv", log)
    whole, short = read_log(tmp_path / "log.csv"), read_log(tmp_path / "log.csv", skip=1.0)
    assert (whole.skipped, short.skipped) == (0.0, 1.0)
    assert np.array_equal(short.u, whole.slice(float(whole.t[0]) + 1.0).u)
    assert short.sha256 == whole.sha256  # of the file
    assert short.slice(stop=2.0).skipped == 1.0


@pytest.mark.parametrize("skip", [-1.0, float("nan"), float("inf")])
def test_a_skip_that_is_no_time_is_refused(tmp_path: Path, skip: float) -> None:
    write_log(tmp_path / "log.csv", paper_log(T=0.005, duration=3.0)[0])
    with pytest.raises(LogError, match="not negative"):
        read_logs([tmp_path / "log.csv"], skip=skip)
