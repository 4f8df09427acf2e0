"""Log files that nobody would write on purpose, and what reading one may do: a Log, or a LogError with a sentence."""

from __future__ import annotations

import io
import random
import warnings
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from identification.kalman.record import stretches
from identification.logs.formats import WRITERS
from identification.logs.log import LogError, LogWarning
from identification.logs.reading import read_log

from .damage import ODD_CELLS, WORDS, damaged_bytes

TEXT = (".csv", ".txt", ".tsv", ".dat")
_HEADERS = (
    ("t", "q1", "q2", "u"),
    ("Time [s]", "theta", "alpha", "voltage"),
    ("u", "t", "q2", "q1"),
    ("time_ms", "arm_deg", "pend_deg", "vm"),
    ("t", "q1", "q2", "u", "d", "state"),
)
_OPTIONS: dict[str, tuple[Any, ...]] = {
    "columns": ("t=Time [s],q1=theta,q2=alpha,u=voltage", "t=t,q1=q1", {"u": "d"}),
    "unit": ("deg", "rad", "counts", {"q1": "deg"}),
    "pendulum_zero": ("hanging", "upright"),
    "flip": ("q1", "q2,u"),
    "encoder_counts": ("4096", "2048,4096", "1e-300", "1e300", "0"),
    "input_unit": ("V", "N·m"),
    "controller_gain": ("1 2 3 4", "nan 0 0 0"),
    "time_unit": ("s", "ms", "us", "d"),
    "skip": (0.01, 0.1, 1e9),
    "constant_command": ("warn", "ignore"),
}


@dataclass(frozen=True)
class LogCase:
    """A file's ending and content, and the options that it is read with."""

    ending: str
    raw: bytes
    options: dict[str, Any] = field(default_factory=dict)


def log_case(draw: random.Random, endings: tuple[str, ...] = (*TEXT, ".parquet", ".npz")) -> LogCase:
    """A file of one of these endings."""
    ending = draw.choice(endings)
    options = {name: draw.choice(values) for name, values in _OPTIONS.items() if draw.random() < 0.06}
    if ending in TEXT:
        raw = _text(draw, ending)
        if draw.random() < 0.3:
            raw = damaged_bytes(draw, raw)
    else:
        raw = draw.choice(_whole(ending)) if draw.random() < 0.8 else _odd(draw, ending)
        if draw.random() < 0.9:
            raw = damaged_bytes(draw, raw, draw.choice((1, 2, 6)))
    return LogCase(ending, raw, options)


def try_log(case: LogCase, folder: Path) -> str:
    """ "read" or "refused". Anything else that reading raises is a fault, and is let through."""
    path = folder / f"case{case.ending}"
    path.write_bytes(case.raw)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # what a library warns of is no sentence for a user
        warnings.simplefilter("ignore", LogWarning)
        try:
            log = read_log(path, **case.options)
        except LogError as error:
            if not 20 <= len(str(error)) <= 3000:
                raise AssertionError(f"a message of {len(str(error))} letters: {str(error)[:200]}") from None
            return "refused"
        str(log)
        try:
            stretches([log])
        except LogError:
            return "refused"
    return "read"


def _columns(draw: random.Random) -> dict[str, np.ndarray]:
    n = draw.choice((*[60] * 8, *[90] * 8, 50, 49, 2, 0))
    k = np.arange(n)
    usual = draw.random() < 0.8
    T = draw.choice((0.002, 0.01)) if usual else draw.choice((0.3, 1.0, 1e-7, 1e-300, 1e6, 2e-3 / 86400))
    q = {"q1": 0.1 * np.sin(0.3 * k), "q2": np.pi - 0.4 * np.cos(0.2 * k), "u": np.sign(np.sin(0.5 * k))}
    if draw.random() < 0.1:
        q["u"] = q["u"] * draw.choice((0.0, 1e7, 1e-300, 1e300))
    if draw.random() < 0.15:
        scale = draw.choice((1e-300, 1e-8, 57.0, 1e9, 1e300))
        q |= {"q1": q["q1"] * scale, "q2": q["q2"] * scale}
    return {"t": T * k, **q}


def _text(draw: random.Random, ending: str) -> bytes:
    columns = _columns(draw)
    header = _HEADERS[0] if draw.random() < 0.7 else draw.choice(_HEADERS)
    width = len(header)
    own = list(columns.values()) + [columns["u"]] * (width - 4)
    digits = draw.choice((3, 9, 9, 17))
    rows = [[f"{value:.{digits}g}" for value in row] for row in zip(*own, strict=True)]
    if rows:
        for _ in range(draw.choice((0, 0, 0, 0, 1, 1, 2, 9))):
            row = draw.choice(rows)
            row[draw.randrange(len(row))] = draw.choice(ODD_CELLS)
            kind = draw.randrange(12)
            if kind == 0:
                row.pop()
                if not row:
                    row.append("")
            elif kind == 1:
                row.append("")
            elif kind == 2:
                rows.append(list(row))
            elif kind == 3:
                rows.reverse()
    delimiter = "\t" if ending == ".tsv" else draw.choice((",", ",", ";", " ", "\t"))
    if delimiter != "," and draw.random() < 0.3:
        rows = [[cell.replace(".", ",") for cell in row] for row in rows]
    head = [f"# {key}: {value}" for key, value in _metadata(draw)]
    lines = [*head, *([delimiter.join(header)] if draw.random() < 0.95 else []), *map(delimiter.join, rows)]
    if draw.random() < 0.1:
        lines.insert(draw.randrange(len(lines) + 1), draw.choice(("", "sep=;", "a title", "# a: b: c", "#", '"')))
    text = draw.choice(("\n", "\n", "\r\n", "\r")).join(lines) + "\n"
    return text.encode("utf-8" if draw.random() < 0.9 else draw.choice(("utf-8-sig", "latin-1", "utf-16")), "replace")


def _metadata(draw: random.Random) -> list[tuple[str, str]]:
    keys = (
        "input_unit",
        "pendulum_zero",
        "encoder_counts",
        "device",
        "controller_gain",
        "angle_unit",
        "note",
        "t",
        "é",
    )
    values = (
        "V",
        "N·m",
        "hanging",
        "4096",
        "2048 4096",
        "-1",
        "0",
        "nan",
        "1e400",
        "1 2 3 4",
        "deg",
        "",
        "x" * 300,
        ":",
    )
    return [(draw.choice(keys), draw.choice(values)) for _ in range(draw.choice((0, 0, 0, 1, 3)))]


def _odd(draw: random.Random, ending: str) -> bytes:
    """A whole file with a column of a kind that is none of a log's."""
    columns: dict[str, Any] = dict(_columns(draw))
    n = len(columns["t"])
    odd: tuple[Any, ...] = (
        np.array(["1.5"] * n),
        np.array([b"x"] * n),
        np.arange(n) * 1j,
        np.arange(n) % 2 == 0,
        np.arange(n).astype("datetime64[ms]"),
        np.arange(n).astype("timedelta64[us]"),
        np.arange(n, dtype=np.uint8),
        np.arange(n, dtype=np.float16),
        np.full(n, np.nan),
        np.zeros((n, 3)),
        np.zeros((2, n)),
        np.zeros((n, 40)),
        np.zeros((n, 2, 2)),
        np.zeros(0),
        np.float64(3.0),
        np.array("text"),
        np.arange(n + 1.0),
        np.zeros(n, dtype=[("a", float), ("b", int)]),
    )
    columns[draw.choice((*columns, "extra", "encoder_counts", "a b", "é" * 40))] = draw.choice(odd)
    out = io.BytesIO()
    if ending == ".npz":
        np.savez(out, **columns)
    elif ending == ".mat":
        from scipy.io import savemat

        try:
            savemat(out, {"run": columns} if draw.random() < 0.3 else columns)
        except (ValueError, TypeError):  # names and types that it does not write
            return b""
    else:
        import pyarrow
        import pyarrow.parquet

        lists = [[1.0, 2.0]] * n if draw.random() < 0.3 else [None if k % 3 else 1.0 for k in range(n)]
        arrays = [values if values.ndim == 1 and len(values) == n and values.dtype.names is None else lists
                  for values in map(np.asarray, columns.values())]  # fmt: skip
        try:
            table = pyarrow.table([pyarrow.array(a) for a in arrays], names=list(columns))
            if draw.random() < 0.2:
                table = table.append_column("t", pyarrow.array(np.zeros(n)))
            pyarrow.parquet.write_table(table, out)
        except (pyarrow.ArrowException, TypeError, ValueError):
            return b""
    return out.getvalue()


@cache
def _whole(ending: str) -> list[bytes]:
    """Undamaged files of a binary format to start from."""
    draw = random.Random(20)
    found = []
    for n in range(12):
        columns = _columns(draw)
        while len(columns["t"]) < 50:
            columns = _columns(draw)
        facts = {"input_unit": "V", "encoder_counts": "4096"} if n % 2 else {}
        if ending == ".npz" and n % 3 == 0:  # members that are not compressed are damaged, not only their checksums
            raw = io.BytesIO()
            np.savez(raw, **columns)  # type: ignore[arg-type]
            found.append(raw.getvalue())
            continue
        if ending == ".mat" and n % 3 == 0:
            from scipy.io import savemat

            raw = io.BytesIO()
            savemat(raw, {"run": columns, "cell": np.array([1, "a"], dtype=object)}, do_compression=n % 2 == 0)
            found.append(raw.getvalue())
            continue
        import tempfile

        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"whole{ending}"
            WRITERS[ending](path, columns, facts)
            found.append(path.read_bytes())
    return [*found, *WORDS[-3:-1]]
