"""Log files as people write them, and what reading them warns of."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np

from identification.logs.log import Log, LogWarning
from identification.logs.reading import read_log


def rows(n: int = 60):
    k = np.arange(n)
    return {"t": k * 0.01, "q1": np.round(0.1 * np.sin(k), 4), "q2": np.round(0.1 * np.cos(k), 4), "u": k % 3 - 1.0}


def changed(column: str, row: int, value) -> dict[str, list]:
    """A column of `rows` with another value in one row."""
    values = rows()[column].tolist()
    values[row] = value
    return {column: values}


def write_csv(path, columns: dict[str, np.ndarray], head: str = ""):
    rows = zip(*(np.asarray(c).tolist() for c in columns.values()), strict=True)
    text = head + ",".join(columns) + "\n" + "\n".join(",".join(map(str, row)) for row in rows) + "\n"
    path.write_text(text, encoding="utf-8")
    return path


def quietly(path, *args, **kwargs) -> Log:
    """Read, with the warnings about these made-up motions left out."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LogWarning)
        return read_log(path, *args, **kwargs)


def csv(tmp_path: Path, table=None, head: str = "", **changes) -> Path:
    return write_csv(tmp_path / "log.csv", (table or rows()) | changes, head)


def warned(path: Path, **options) -> str:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        read_log(path, **options)
    return "\n".join(str(w.message) for w in caught if issubclass(w.category, LogWarning))
