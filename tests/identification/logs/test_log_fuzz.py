"""Files with anything in them: a log or an error with its place, never a crash."""

from __future__ import annotations

import contextlib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from identification.logs.log import Log, LogError
from identification.logs.reading import read_log
from tests.files import changed, quietly, rows, write_csv


@settings(max_examples=150)
@given(st.binary(max_size=400) | st.text("tq12u,;.\n#:- e\t\"'0abn", max_size=300).map(str.encode))
def test_arbitrary_bytes_never_crash_the_csv_reader(tmp_path_factory, content):
    path = tmp_path_factory.getbasetemp() / "fuzz.csv"
    path.write_bytes(content)
    with pytest.raises(LogError):
        read_log(path)


broken_cells = st.sampled_from(["", "nan", "inf", "-", "1e", "NULL", "1,5", "0x10", '"', "é", "1 2", "1e400"])


@settings(max_examples=100)
@given(st.integers(0, 59), st.sampled_from(["t", "q1", "q2", "u"]), broken_cells)
def test_one_broken_cell_is_always_an_error_with_its_place(tmp_path_factory, row, column, cell):
    path = tmp_path_factory.getbasetemp() / "cell.csv"
    write_csv(path, rows() | changed(column, row, cell))
    with pytest.raises(LogError) as caught:
        read_log(path)
    if cell != '"':  # an open quotation mark swallows what follows
        assert f"line {row + 2}" in str(caught.value)


@settings(max_examples=60)
@given(st.sampled_from([".npz", ".parquet"]), st.data())
def test_damaged_binary_files_never_crash(tmp_path_factory, suffix, data):
    from identification.logs.log import write_log

    folder = tmp_path_factory.getbasetemp()
    whole = folder / f"whole{suffix}"
    if not whole.exists():
        table = rows(100)
        write_log(whole, Log(table["t"], table["q1"], table["q2"], table["u"]))
    content = bytearray(whole.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    damaged = folder / f"damaged{suffix}"
    damaged.write_bytes(content[: data.draw(st.integers(1, len(content)))])
    with contextlib.suppress(LogError):
        assert isinstance(quietly(damaged), Log)
