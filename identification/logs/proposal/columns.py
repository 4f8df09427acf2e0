"""Which column is which: by the names, checked by the motion, or by the motion alone where names say nothing."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from ..checks import LogError
from ..said import COLUMNS
from ..table import Table
from ..vocabulary import OTHER, fits, words
from .values import Confidence

SPOKEN = {"t": "time", "q1": "arm angle", "q2": "pendulum angle", "u": "command"}
_MOST = 8  # columns that are tried as angles
_LARGEST = 1e100  # the third power of a smaller number is finite


@dataclass(frozen=True)
class Choice:
    """A column of the file for one of ours, None if none is found."""

    column: str | None
    confidence: Confidence
    reason: str
    alternatives: tuple[str, ...] = ()


def numeric(table: Table) -> dict[str, np.ndarray]:
    """The columns that hold numbers (dates as seconds), of the table's length, NaN where a cell is empty or so large
    that nothing can be computed of it (`check_numbers` names it)."""
    found = {}
    for name, values in table.columns.items():
        try:
            found[name] = table.numbers(name)
        except LogError:
            if values.dtype.kind in "OUS" and len(values) and _mostly_numbers(values):
                found[name] = np.full(len(values), np.nan)
    length = max(map(len, found.values()), default=0)
    return {n: np.where(np.abs(x) < _LARGEST, x, np.nan) for n, x in found.items() if len(x) == length}


def _mostly_numbers(cells: np.ndarray) -> bool:
    from ..table import number

    some = cells[:: max(1, len(cells) // 50)]
    return sum(number(c) is not None for c in some) > 0.5 * len(some)


def named(found: Mapping[str, np.ndarray], given: Mapping[str, str], dated: Collection[str] = ()) -> dict[str, Choice]:
    """What was said, what the names say, and for time a column that increases; the motion is not asked. dated: columns
    of dates, which give way to one of numbers."""
    choices = {}
    for ours, theirs in given.items():
        inside = [c for c in found if c.endswith(f".{theirs}")]
        there = theirs if theirs in found else inside[0] if len(inside) == 1 else None
        if there is not None:
            choices[ours] = Choice(there, Confidence.sure, "as you say")
        else:
            choices[ours] = Choice(None, Confidence.open, f"you say {theirs}, and there is no such column of numbers")
    free = [c for c in found if c not in {choice.column for choice in choices.values()}]
    scores = {ours: {c: fits(c, ours) for c in free} for ours in COLUMNS if ours not in choices}
    for ours in sorted(scores, key=lambda role: -max(scores[role].values(), default=0)):
        taken = {choice.column for choice in choices.values()}
        best = max((s for c, s in scores[ours].items() if c not in taken), default=0)
        same = [c for c, s in scores[ours].items() if s == best and c not in taken] if best else []
        if ours == "t" and len(same) != 1:
            stamps = same or [c for c in free if c not in taken]
            choices["t"] = _clock(found, [c for c in stamps if c not in dated] or stamps)
        elif len(same) == 1:
            sure = Confidence.sure if best >= 2 else Confidence.likely
            choices[ours] = Choice(same[0], sure, "by its name")
        elif same:
            choices[ours] = Choice(same[0], Confidence.open, f"{', '.join(same)} could be meant", tuple(same))
        else:
            choices[ours] = Choice(
                None, Confidence.open, "no column of numbers is named so", tuple(c for c in free if c not in taken)
            )
    return {ours: choices[ours] for ours in COLUMNS}


def _clock(found: Mapping[str, np.ndarray], names: list[str]) -> Choice:
    """The column that increases throughout; the first that does not only count."""
    rising = [c for c in names if len(found[c]) > 2 and (np.diff(found[c]) > 0).all()]
    counting = [c for c in rising if np.array_equal(found[c], found[c][0] + np.arange(len(found[c])))]
    stamps = [c for c in rising if c not in counting] or counting
    if len(stamps) == 1:
        return Choice(stamps[0], Confidence.sure, "it is the only column that increases throughout")
    if stamps:
        return Choice(stamps[0], Confidence.likely, f"{', '.join(stamps)} increase throughout", tuple(stamps))
    if names:
        return Choice(names[0] if len(names) == 1 else None, Confidence.open, "no column increases throughout")
    return Choice(None, Confidence.open, "no column increases throughout")


def angle_candidates(found: Mapping[str, np.ndarray], choices: Mapping[str, Choice]) -> list[str]:
    """Columns that may be angles or the command: neither time nor, by their names, something else."""
    time = choices["t"].column
    return [c for c in found if c != time and not set(words(c)) & OTHER and np.ptp(found[c]) > 0][:_MOST]
