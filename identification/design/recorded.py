"""An excitation from a file: what `furuta excite` wrote, or any table with a time and a command column."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..logs.checks import LogError
from ..logs.formats import read_table
from .signals import Signal

_COLUMNS = ("d", "u")


@dataclass(frozen=True)
class Played(Signal):
    """values (n,) at times t (n,) [s] from zero, each held until the next; zero after the last one's own step."""

    t: NDArray[np.float64]
    values: NDArray[np.float64]

    def __call__(self, t: Any) -> Any:
        at = np.asarray(t, dtype=float) + 1e-9  # a sample's own time, as rounded as it may be
        held = self.values[np.clip(np.searchsorted(self.t, at, side="right") - 1, 0, None)]
        return np.where((at >= 0.0) & (at < 2.0 * self.t[-1] - self.t[-2]), held, 0.0)[()]


def read_signal(path: str | os.PathLike[str], scale: float = 1.0) -> Played:
    """The column d or u of a file over its column t, times `scale`; time starts at zero.

    Raises FileNotFoundError, and LogError (a ValueError) for other columns, or a t that does not increase.
    """
    table = read_table(path)
    column = next((c for c in _COLUMNS if c in table.columns), None)
    if "t" not in table.columns or column is None:
        raise LogError(
            f"{table.name}: columns {', '.join(table.columns)}; expected t [s] and d (added to the controller's "
            "command) or u, as `furuta excite` writes them"
        )
    t, values = table.numbers("t"), scale * table.numbers(column)
    if len(t) < 2:
        raise LogError(f"{table.name}: got {len(t)} row of numbers, expected two or more rows of finite numbers")
    for name, numbers in (("t", t), (column, values)):
        if bad := np.flatnonzero(~np.isfinite(numbers)).tolist():
            raise LogError(
                f"{table.name}: column {name} holds {numbers[bad[0]]} at {table.where(bad[0])}, "
                "expected finite numbers; mend or delete that row"
            )
    if back := np.flatnonzero(np.diff(t) <= 0).tolist():
        raise LogError(
            f"{table.name}: t goes from {t[back[0]]:g} to {t[back[0] + 1]:g} at {table.where(back[0] + 1)}, "
            "expected t increasing; sort the rows or delete that one"
        )
    return Played(t - t[0], values)
