"""The torque of the effects that were added, as a function of the motion: the curve through the "where" panels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import Plant
from identification.diagnosis.added_torque import added_torque, is_function_of_motion, motion_of
from identification.diagnosis.locate.torque_maps import ROWS, VARIABLES, Map, variable
from identification.discrepancy.basis import Signals
from identification.logs.log import Log

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Law:
    """Torque (N, 2) [{u}] that effects add to the two rows along a log's motion (`signals`).

    of_time: whether one of the effects changes with the time of the run, so that no variable of the motion shows it.
    """

    names: tuple[str, ...]
    signals: Signals
    torque: Array
    of_time: bool = False

    def mean(self, shown: Map) -> tuple[Array, Array]:
        """(m,) place and mean torque in the bins of a map; NaN in a bin that the motion does not visit."""
        values = variable(self.signals, shown.variable)
        m = len(shown.mean)
        at = np.clip(np.searchsorted(shown.edges, values, side="right") - 1, 0, m - 1)
        count = np.bincount(at, minlength=m)
        with np.errstate(invalid="ignore"):
            place = np.bincount(at, values, m) / count
            torque = np.bincount(at, self.torque[:, ROWS.index(shown.row)], m) / count
        return place, torque

    def best_seen(self, maps: Sequence[Map]) -> Map:
        """The map whose variable says most about the torque: the largest share of its variance between bins."""
        row = self.row(maps)
        mine = [m for m in maps if m.row == ROWS[row]]
        return max(mine, key=lambda m: (round(self._share(m), 2), -VARIABLES.index(m.variable)))

    def row(self, maps: Sequence[Map]) -> int:
        """The row, 0 arm or 1 pendulum, on which the law stands out most of what the maps can tell."""
        return int(np.argmax(np.mean(self.torque**2, axis=0) / np.maximum(_scale(maps), 1e-300)))

    def _share(self, shown: Map) -> float:
        total = float(np.var(self.torque[:, ROWS.index(shown.row)]))
        _, mean = self.mean(shown)
        return float(np.nanvar(mean)) / total if total > 0 else 0.0


def _scale(maps: Sequence[Map]) -> Array:
    """(2,) typical variance of what the maps of each row can tell."""
    return np.array([np.median(np.concatenate([m.std for m in maps if m.row == row])) ** 2 for row in ROWS])


def law_of(plant: Plant, names: Sequence[str], logs: Sequence[Log]) -> Law | None:
    """The torque of the plant's effects `names` along the longest of the logs; None where an effect keeps a memory of
    the motion, acts on the reading or delays the command, so that its torque is no function of the motion.

    Raises ValueError where the plant's filter loses the log.
    """
    effects = [effect for name in names if (effect := plant.effect(name)) is not None]
    if not effects or not all(is_function_of_motion(effect.type) for effect in effects):
        return None
    signals = motion_of(plant, logs)
    of_time = any(effect.type.follows_clock for effect in effects)
    return Law(tuple(names), signals, added_torque(plant, names, signals), of_time)
