"""Excitations from files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from identification.design.recorded import Played, read_signal
from identification.logs.checks import LogError
from identification.logs.formats import write_table


@given(st.integers(2, 40), st.floats(1e-3, 0.1))
def test_every_sample_is_held_to_the_next(n: int, T: float) -> None:
    values = np.random.default_rng(n).uniform(-1, 1, n)
    played = Played(np.arange(n) * T, values)
    for part in (0.0, 0.3, 0.9):
        assert played((np.arange(n) + part) * T) == pytest.approx(values)
        assert float(played((n - 1 + part) * T)) == values[-1]
    assert played((n + 0.5) * T) == 0.0
    assert played(-T) == 0.0


@pytest.mark.parametrize("ending", [".csv", ".npz", ".mat"])
@pytest.mark.parametrize("column", ["d", "u"])
def test_a_file_is_read_from_its_first_stamp_on(tmp_path: Path, ending: str, column: str) -> None:
    t, values = 7.0 + 0.01 * np.arange(50), np.sin(np.arange(50))
    write_table(tmp_path / f"x{ending}", {"t": t, column: values}, {})
    assert read_signal(tmp_path / f"x{ending}", 2.0)(t - 7.0) == pytest.approx(2.0 * values)


@pytest.mark.parametrize(
    ("columns", "word"),
    [
        ({"t": [0.0, 1.0], "q1": [0.0, 1.0]}, "expected t"),
        ({"d": [0.0, 1.0]}, "expected t"),
        ({"t": [0.0, 0.0], "d": [0.0, 1.0]}, "increasing"),
        ({"t": [0.0, 1.0], "d": [0.0, np.inf]}, "finite"),
    ],
)
def test_other_files_are_refused(tmp_path: Path, columns: dict[str, list[float]], word: str) -> None:
    write_table(tmp_path / "x.npz", {name: np.array(v) for name, v in columns.items()}, {})
    with pytest.raises(LogError, match=word):
        read_signal(tmp_path / "x.npz")
