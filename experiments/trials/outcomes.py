"""Outcomes in a table, and back: marks that were kept can be counted again without asking anything."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import MISSING, asdict, fields
from pathlib import Path
from typing import Any

import pandas as pd

from .scoring import Outcome

_NUMBERS = ("ratio", "closed_fraction", "after_over_floor", "runtime_s")
_COUNTS = ("found", "false")
_TRUTHS = ("inside", "leftover", "reported_absorbed")


def outcomes_table(outcomes: Sequence[Outcome]) -> pd.DataFrame:
    """One row per trial, as outcomes.csv has it: names separated by spaces, covered as JSON."""
    rows = [asdict(o) | {"named": " ".join(o.named), "covered": json.dumps(dict(o.covered))} for o in outcomes]
    return pd.DataFrame(rows)


def read_outcomes(path: Path) -> list[Outcome]:
    """Read what `outcomes_table` was written to.

    Raises ValueError where a column is missing or an entry cannot be read, OSError where there is no such file."""
    wanted = {field.name: field.default is MISSING for field in fields(Outcome)}
    try:
        table = pd.read_csv(path, dtype=str, keep_default_na=False)
    except (pd.errors.ParserError, pd.errors.EmptyDataError, UnicodeDecodeError) as error:
        raise ValueError(f"{path} is no table: {error}; expected an outcomes.csv of furuta trials") from None
    if missing := sorted(name for name, needed in wanted.items() if needed and name not in table.columns):
        raise ValueError(f"{path} lacks {', '.join(missing)}; expected an outcomes.csv of furuta trials")
    outcomes = []
    for line, row in enumerate(table.to_dict("records"), start=2):
        try:
            outcomes.append(Outcome(**{name: _read(name, row[name]) for name in wanted if name in row}))
        except (KeyError, ValueError) as error:
            raise ValueError(f"{path}, line {line}: cannot read {error}") from None
    return outcomes


def _read(name: str, text: str) -> Any:
    if name in _NUMBERS:
        return float(text) if text else None
    if name in _COUNTS:
        return int(text)
    if name in _TRUTHS:
        return {"True": True, "False": False}[text]
    if name == "named":
        return tuple(text.split())
    return json.loads(text) if name == "covered" else text
