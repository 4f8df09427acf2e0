"""File formats: each reader returns a `Table` of named columns and text metadata, each writer takes one.

CSV (also .txt, .tsv, .dat, .lvm, packed as .gz), Parquet, Feather, NPZ and MAT; with their packages installed MAT
7.3, TDMS, MCAP and bags of ROS. `register` adds a format by the ending of its files; every command and `read_log`
then take it. Nothing here knows what a pendulum is.
"""

from __future__ import annotations

import csv
import hashlib
import os
import re
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from furuta_gym.files import in_short, whole_file

from .bags import read_bag, read_mcap
from .checks import LogError
from .labview import read_tdms
from .layouts import from_variables
from .mat_file import mat_variables
from .number_block import number_block
from .opening import check_cells, check_file
from .other_endings import REMEDIES
from .table import Table, listed, number
from .text import comment_of, dates, decoded, units_row, unpacked

_LOOKED_AT = 200  # lines, of which the last tell what separates cells

Reader = Callable[[Path], Table]
"""Reads a file that exists. Raises LogError for one that is not of its format."""
Writer = Callable[[Path, Mapping[str, np.ndarray], Mapping[str, str]], None]
"""Writes columns of equal length and metadata of one line each to a path."""


def register(ending: str, reader: Reader, writer: Writer | None = None) -> None:
    """Add a format: how files with this ending (as ".tdms") are read and, where given, written.

    Raises ValueError for an ending without its dot or with capitals, or one that is taken.
    """
    if not re.fullmatch(r"\.[a-z0-9]+", ending):
        raise ValueError(f"ending {ending!r}: expected a dot and small letters or digits, as .tdms")
    if ending in READERS:
        raise ValueError(f"ending {ending!r} is taken; there are {', '.join(READERS)}")
    READERS[ending] = reader
    if writer is not None:
        WRITERS[ending] = writer


def read_table(path: str | os.PathLike[str]) -> Table:
    """Read a file in the format that its ending names. Raises LogError for anything that is not such a file."""
    path = Path(path)
    if os.path.isfile(path / "metadata.yaml"):  # a folder: a bag of ROS 2
        return replace(READERS[".bag"](path), sha256=file_hash(path))
    reader = READERS.get(ending_of(path))
    if reader is None and not os.path.isdir(path):
        remedy = REMEDIES.get(path.suffix.lower(), "")
        raise LogError(
            f"{path.name}: unknown ending {path.suffix!r}. Expected one of {', '.join(READERS)}. {remedy}".strip()
        )
    check_file(path)
    assert reader is not None  # a folder was refused
    digest, table = file_hash(path), reader(path)
    if table.columns and not max(map(len, table.columns.values())):
        raise LogError(f"{path.name}: 0 samples. There is a header, and no row below it. Expected one row per sample.")
    return replace(table, sha256=digest)


def file_hash(path: str | os.PathLike[str]) -> str:
    """SHA-256 of a file, or of the files of a folder (a bag of ROS 2) one after the other by name."""
    path = Path(path)
    if not path.is_dir():
        with open(path, "rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    digest = hashlib.sha256()
    for part in sorted(p for p in path.rglob("*") if p.is_file()):
        digest.update(part.read_bytes())
    return digest.hexdigest()


def ending_of(path: Path) -> str:
    """The ending by which a reader is found: that of a packed file without the .gz."""
    return Path(path.stem if path.suffix.lower() == ".gz" else path.name).suffix.lower()


def write_table(path: str | os.PathLike[str], columns: Mapping[str, np.ndarray], metadata: Mapping[str, str]) -> None:
    """Write a table whole or not at all. Raises OSError with its name."""
    path = Path(path)
    writer = WRITERS.get(path.suffix.lower())
    if writer is None:
        raise LogError(f"{path.name}: cannot write {path.suffix!r}. Expected one of {', '.join(WRITERS)}.")
    with whole_file(path) as new:  # keeps the ending: some writers would add it
        writer(new, columns, metadata)


# --- text -------------------------------------------------------------------------------------------------


def _read_csv(path: Path) -> Table:
    raw = unpacked(path)
    return _read_long(path.name, raw) or _read_text(path.name, raw)


def _read_long(name: str, raw: bytes) -> Table | None:
    """As `_read_text`, in a fraction of its time and memory; None for a file that it cannot read so."""
    block = number_block(raw)
    if block is None:
        return None
    try:
        top = _read_text(name, block.head)
        columns = {column: top.numbers(column) for column in top.columns}
    except LogError:  # of the whole file the other reader says more
        return None
    if len(columns) != block.values.shape[1] or top.lines is None:
        return None
    joined = {c: np.concatenate([first, block.values[:, j]]) for j, (c, first) in enumerate(columns.items())}
    lines = np.concatenate([top.lines, block.first_line + np.arange(len(block.values))])
    return Table(name, joined, top.metadata, lines, top.units, top.notes)


def _read_text(name: str, raw: bytes) -> Table:
    text, notes = decoded(name, raw)
    numbered = [(i, line) for i, line in enumerate(text.splitlines(), 1) if line.strip()]
    said = [comment_of(line) for _, line in numbered]
    comments = [comment for comment in said if comment is not None]
    body = [pair for pair, comment in zip(numbered, said, strict=True) if comment is None]
    if not body:
        raise LogError(f"{name}: the file holds no rows. Expected a header t,q1,q2,u and one row per sample.")
    delimiter = _delimiter(body)
    body = _from_header(_below_labview(name, body, delimiter), delimiter)
    if delimiter in body[0][1]:
        split = _csv_rows(name, [line for _, line in body], delimiter)
    else:
        split = [line.split() for _, line in body]
    header, rows, lines = split[0], split[1:], [i for i, _ in body[1:]]
    if all(number(cell) is not None for cell in header):
        header, rows, lines = _commented_header(name, comments, len(header)), split, [i for i, _ in body]
    while header and not header[-1]:  # a delimiter at the end of each line
        header = header[:-1]
    header = [cell or f"column {j}" for j, cell in enumerate(header, 1)]  # as pandas leaves that of its index
    units = units_row(header, rows[0]) if rows else {}
    if units:
        rows, lines = rows[1:], lines[1:]
    columns = _columns(name, header, rows, lines, delimiter)
    pairs = (comment.split(":", 1) for comment in comments if ":" in comment)
    metadata = {k.strip(): v.strip().rstrip(";,\t ") for k, v in pairs}  # spreadsheets fill each line with delimiters
    return Table(name, columns, metadata, np.array(lines, dtype=int), units, notes)


def _bare(line: str) -> str:
    return re.sub(r'"[^"]*"', "", line)  # a comma in a quoted cell separates nothing


def _delimiter(body: list[tuple[int, str]]) -> str:
    """What separates the cells: what leaves most numbers between, as commas may be decimal ones, and texts may hold
    any; where none leaves some, what the first line has most of."""
    lines = [_bare(line) for _, line in body[:_LOOKED_AT][-20:]]
    numbers = {d: sum(_numbers_between(line, d) for line in lines) for d in "\t;,"}
    best = max(numbers, key=lambda d: numbers[d])
    return best if numbers[best] else max(",;\t", key=body[0][1].count)


def _numbers_between(line: str, delimiter: str) -> int:
    cells = line.split(delimiter)
    return 0 if len(cells) < 2 else sum(number(cell.strip()) is not None for cell in cells)


def _below_labview(name: str, body: list[tuple[int, str]], delimiter: str) -> list[tuple[int, str]]:
    """What stands below the two headers of a LabVIEW measurement, with a cell for the comment in every row.

    Raises LogError for a file that holds more than one."""
    if not body[0][1].startswith("LabVIEW Measurement"):
        return body
    ends = [i for i, (_, line) in enumerate(body) if line.startswith("***End_of_Header***")]
    if len(ends) > 2:
        raise LogError(f"{name}: holds {len(ends) - 1} measurements. Expected one; save each as a file of its own.")
    if not ends or ends[-1] + 2 > len(body):
        return body
    names, *rows = body[ends[-1] + 1 :]
    cells = names[1].count(delimiter)
    if not names[1].rstrip().endswith(f"{delimiter}Comment"):
        return [names, *rows]
    return [names, *((at, row + delimiter if row.count(delimiter) == cells - 1 else row) for at, row in rows)]


def _from_header(body: list[tuple[int, str]], delimiter: str) -> list[tuple[int, str]]:
    """Without a title, or Excel's `sep=;`, above the header: lines before it that have fewer separators than it.

    Rows of numbers are no header, though they may have a separator more, at their end."""
    separators = [_bare(line).count(delimiter) for _, line in body[:10]]
    start = separators.index(max(separators))
    cells = [cell.strip() for cell in body[start][1].split(delimiter)]
    return body if all(number(cell) is not None for cell in cells if cell) else body[start:]


def _csv_rows(name: str, lines: list[str], delimiter: str) -> list[list[str]]:
    try:
        rows = [[cell.strip() for cell in row] for row in csv.reader(lines, delimiter=delimiter, skipinitialspace=True)]
    except csv.Error as error:
        raise LogError(f"{name}: not a CSV file ({error}).") from None
    if len(rows) != len(lines):
        raise LogError(f"{name}: a quotation mark is opened and not closed. Expected numbers without quotes.")
    return rows


def _commented_header(name: str, comments: list[str], width: int) -> list[str]:
    """Column names from the last comment, as numpy.savetxt writes them."""
    for comment in reversed(comments):
        cells = [cell.strip() for cell in comment.replace(";", ",").replace("\t", ",").split(",")]
        cells = cells if len(cells) == width else comment.split()
        if len(cells) == width and ":" not in comment:
            return cells
    raise LogError(f"{name}: the first line holds numbers only. Expected a header; put t,q1,q2,u above them.")


def _columns(
    name: str, header: list[str], rows: list[list[str]], lines: list[int], delimiter: str
) -> dict[str, np.ndarray]:
    width = len(header)
    repeated = sorted(h for h, times in Counter(header).items() if times > 1)
    if repeated:
        raise LogError(f"{name}: the header names {listed(repeated)} twice. Expected each name once.")
    for i, (row, line) in enumerate(zip(rows, lines, strict=True)):
        cells = "1 cell" if len(row) == 1 else f"{len(row)} cells"
        if any(row[width:]):
            raise LogError(f"{name}: line {line} has {cells}. {_too_many(header, row, delimiter)}")
        if len(row) < width:
            way = "Was the recording cut off there? Then delete that line."
            if len(rest := rows[i:]) > 1 and all(len(other) < width for other in rest):
                way = f"Are these notes below the recording? Then delete lines {line} to {lines[-1]}."
            raise LogError(
                f"{name}: line {line} has {cells}. Expected {width}, as in the header ({listed(header)}). {way}"
            )
    columns = {}
    for j, column in enumerate(header):
        cells = [row[j] for row in rows]
        try:
            columns[column] = np.array([float(cell) for cell in cells], dtype=np.float64)
        except ValueError:
            stamps = dates(cells)
            columns[column] = np.array(cells, dtype=object) if stamps is None else stamps
    return columns


def _too_many(header: list[str], row: list[str], delimiter: str) -> str:
    """What mends a row with more cells than the header: mostly a decimal comma that was taken for a separator."""
    expected = f"Expected {len(header)}, as in the header ({listed(header)})."
    joined = [",".join(pair) for pair in pairwise(row)]
    halves = [j for j, text in enumerate(joined) if re.fullmatch(r"[+-]?\d+,\d+(e[+-]?\d+)?", text, re.IGNORECASE)]
    if delimiter == "," and len(row) == 2 * len(header) and set(range(0, len(row), 2)) <= set(halves):
        return f"{expected} Are {joined[0]} and the others decimal commas? Then separate the columns by semicolons."
    if delimiter != "," or len(row) != len(header) + 1 or not halves:
        return f"{expected} Delete what is too much in that line, or name its column in the header."
    what = f"{joined[halves[0]]} in column {listed([header[halves[0]]])}" if len(halves) == 1 else "one of its pairs"
    return f"{expected} Is {what} a decimal comma? Then write a point, or separate the columns by semicolons."


def _write_csv(path: Path, columns: Mapping[str, np.ndarray], metadata: Mapping[str, str]) -> None:
    lines = [f"# {key}: {value}" for key, value in metadata.items()]
    lines.append(",".join(columns))
    # repr is the shortest text that reads back as the same number
    lines += [",".join(map(repr, row)) for row in zip(*(c.tolist() for c in columns.values()), strict=True)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


# --- binary -----------------------------------------------------------------------------------------------


def _read_parquet(path: Path) -> Table:
    _, parquet = _pyarrow()
    try:
        about = parquet.read_metadata(path)
        check_cells(path.name, about.num_rows * about.num_columns)
        table = parquet.read_table(path)
        columns = {name: table[name].to_numpy() for name in table.column_names}
        stored = table.schema.metadata or {}
    except LogError:
        raise
    except Exception as error:  # of broken pages, metadata or text in them; pyarrow raises half a dozen kinds
        raise LogError(f"{path.name}: not a readable Parquet file ({_in_short(error)}).") from None
    text = {
        k.decode(errors="replace"): v.decode(errors="replace")
        for k, v in stored.items()
        if k not in (b"pandas", b"ARROW:schema")
    }
    return Table(path.name, columns, text)


def _read_feather(path: Path) -> Table:
    _pyarrow()
    from pyarrow import feather

    try:
        table = feather.read_table(path)
        check_cells(path.name, table.num_rows * table.num_columns)
        columns = {name: table[name].to_numpy() for name in table.column_names}
    except LogError:
        raise
    except Exception as error:  # as with Parquet
        raise LogError(f"{path.name}: not a readable Feather file ({_in_short(error)}).") from None
    return Table(path.name, columns)


def _write_parquet(path: Path, columns: Mapping[str, np.ndarray], metadata: Mapping[str, str]) -> None:
    pyarrow, parquet = _pyarrow()
    parquet.write_table(pyarrow.table(dict(columns)).replace_schema_metadata(dict(metadata)), path)


def _pyarrow() -> tuple[Any, Any]:
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise LogError("Parquet files need the package pyarrow. Install it (pip install pyarrow) or use CSV.") from None
    return pyarrow, pyarrow.parquet


def _read_npz(path: Path) -> Table:
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:  # open: numpy leaves broken ones so
            check_cells(path.name, sum(member.file_size for member in archive.zip.infolist()) // 8)
            return from_variables(path.name, {name: archive[name] for name in archive.files})
    except LogError:
        raise
    except Exception as error:  # zipfile, zlib, numpy and the header parser each raise their own
        raise LogError(f"{path.name}: not a readable NPZ file of plain arrays ({_in_short(error)}).") from None


def _in_short(error: Exception) -> str:
    """What a library says of a broken file, on one line and without its traceback."""
    return in_short(" ".join(str(error).split()), 300) or type(error).__name__


def _write_npz(path: Path, columns: Mapping[str, np.ndarray], metadata: Mapping[str, str]) -> None:
    np.savez_compressed(path, **columns, **{key: np.array(value) for key, value in metadata.items()})  # type: ignore[arg-type]


def _read_mat(path: Path) -> Table:
    return from_variables(path.name, mat_variables(path))


def _write_mat(path: Path, columns: Mapping[str, np.ndarray], metadata: Mapping[str, str]) -> None:
    from scipy.io import savemat

    long = [key for key in metadata if len(key) > 31]
    if long:
        raise LogError(f"{path.name}: metadata key {long[0]!r} is too long for MAT (31 letters). Use CSV.")
    savemat(path, {**columns, **metadata}, oned_as="column")


READERS: dict[str, Reader] = {
    **dict.fromkeys((".csv", ".txt", ".tsv", ".dat", ".lvm"), _read_csv),
    ".parquet": _read_parquet,
    **dict.fromkeys((".feather", ".arrow"), _read_feather),
    ".npz": _read_npz,
    ".mat": _read_mat,
    ".tdms": read_tdms,
    ".mcap": read_mcap,
    ".bag": read_bag,
}
WRITERS: dict[str, Writer] = {
    ".csv": _write_csv,
    ".parquet": _write_parquet,
    ".npz": _write_npz,
    ".mat": _write_mat,
}
