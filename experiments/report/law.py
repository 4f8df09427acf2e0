"""The torque of the effects that were added, as a function of the motion: the curve through the "where" panels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import EffectType, Plant
from furuta_gym.plant.dynamics import mass_matrix
from furuta_gym.plant.linearization import state_derivative
from identification.diagnosis.locate.torque_maps import ROWS, VARIABLES, Map, variable
from identification.discrepancy.basis import Signals
from identification.logs.log import Log
from identification.validation.gap import filtered

_MOST = 1500  # points of the motion at which the torque is computed
_HOOKS = {"torque", "theta", "command"}

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Law:
    """Torque (N, 2) [{u}] that effects add to the two rows along a log's motion (`signals`)."""

    names: tuple[str, ...]
    signals: Signals
    torque: Array

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
        row = int(np.argmax(np.mean(self.torque**2, axis=0) / np.maximum(_scale(maps), 1e-300)))
        mine = [m for m in maps if m.row == ROWS[row]]
        return max(mine, key=lambda m: (round(self._share(m), 2), -VARIABLES.index(m.variable)))

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
    if not effects or not all(_drawable(effect.type) for effect in effects):
        return None
    without = plant.replace(effects=tuple(e for e in plant.effects if e.name not in names), covariance=None)
    signals = Signals.of(filtered(plant, max(logs, key=len)))
    every = slice(None, None, -(-len(signals.t) // _MOST))
    signals = Signals(*(getattr(signals, f)[every] for f in ("t", "q", "v", "a", "u", "expected")))
    command = signals.u.copy()
    for effect in effects:
        if kernel := effect.type.kernels.get("command"):
            given = [effect.parameters[a] for a in effect.type.arguments["command"][1:]]
            command = np.array([kernel(u, *given) for u in command])
    rows = []
    for t, q, v, u, tau in zip(signals.t, signals.q, signals.v, signals.u, command, strict=True):
        x = np.array([*q, *v])
        apart = state_derivative(plant, x, tau, t)[2:4] - state_derivative(without, x, u, t)[2:4]
        m11, m12, m22 = mass_matrix(q[1], *without.theta[:4])
        rows.append((m11 * apart[0] + m12 * apart[1], m12 * apart[0] + m22 * apart[1]))
    return Law(tuple(names), signals, np.array(rows))


def _drawable(effect: EffectType) -> bool:
    return set(effect.kernels) <= _HOOKS and not effect.memory
