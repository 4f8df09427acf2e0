"""A file as it was read, before anyone knows what its columns mean: `Table`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .checks import LogError

_LISTED = 40  # names in a sentence


@dataclass(frozen=True)
class Table:
    """Columns by name (1-D arrays, of text where a cell is not a number), metadata, and where a row came from."""

    name: str
    columns: dict[str, np.ndarray]
    metadata: dict[str, str] = field(default_factory=dict)
    lines: np.ndarray | None = None  # line of the file for each row, in text files
    units: dict[str, str] = field(default_factory=dict)  # as the file states them, by column
    notes: tuple[str, ...] = ()  # what a person should know of how it was read
    silent: dict[str, str] = field(default_factory=dict)  # by column, where nothing was recorded and what stands there
    sha256: str | None = None  # of the file, as it was when it was read

    def where(self, row: int) -> str:
        """The place of a row as a person would look for it."""
        return f"line {self.lines[row]}" if self.lines is not None else f"row {row + 1}"

    def numbers(self, column: str) -> np.ndarray:
        """A column as float64; dates and durations in seconds, dates from the first one on.

        Raises LogError, naming the row, where a cell holds text."""
        values = self.columns[column]
        if values.dtype.kind in "Mm" and not np.isnat(values).any():
            since = values - values[0] if values.dtype.kind == "M" and values.size else values
            return since.astype("timedelta64[ns]").astype(np.int64) * 1e-9
        if values.dtype.kind in "fiub":
            return values.astype(np.float64)
        if values.dtype.kind in "OUS":
            for row, cell in enumerate(values):
                if number(cell) is None:
                    shown = "an empty cell" if str(cell).strip() == "" else f"the text {_start(str(cell))!r}"
                    raise LogError(
                        f"{self.name}: {shown} in column {column} at {self.where(row)}. Expected a number. "
                        "Delete or mend that row (the log is cut where a stamp is missing, and prediction starts anew)."
                    )
            return np.array([number(cell) for cell in values], dtype=np.float64)
        kind = {"M": "an empty date", "m": "an empty duration", "c": "complex numbers"}.get(
            values.dtype.kind, "no numbers"
        )
        raise LogError(f"{self.name}: column {column} holds {kind}. Expected real numbers (time in seconds).")


def _start(text: str, most: int = 40) -> str:
    """A text, or its start with a sign that it goes on."""
    return text if len(text) <= most else f"{text[: most - 1]}…"


def listed(names: Sequence[str]) -> str:
    """Names with commas: the first `_LISTED` of them, and of each so many letters as belong in a sentence."""
    more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    return ", ".join(name if len(name) <= 60 else f"{name[:57]}..." for name in names[:_LISTED]) + more


def number(cell: Any) -> float | None:
    """A cell as a number, also with a decimal comma; None if it is none."""
    text = cell.decode(errors="replace") if isinstance(cell, bytes) else str(cell)
    try:
        return float(text.replace(",", ".") if text.count(",") == 1 and "." not in text else text)
    except ValueError:
        return None
