"""The mean missing torque against each variable, with bands.

Not a mean of smoothed torques, which are shrunk and correlated in time, but generalised least squares on the
innovations: one constant torque for each bin, as the filter's own noise model weighs the evidence. The bands come
from sums over blocks of time (a sandwich), so they hold although a wrong model's innovations are correlated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...discrepancy.basis import Columns, Signals
from ...discrepancy.dependence import Variable
from ...discrepancy.response import answers
from ...kalman.likelihood import whiten
from ...kalman.path import FilterPath

Array = NDArray[np.float64]

VARIABLES = (
    Variable.ARM_ANGLE,
    Variable.ARM_SPEED,
    Variable.PENDULUM_ANGLE,
    Variable.PENDULUM_SPEED,
    Variable.COMMAND,
    Variable.TIME,
)
ROWS = ("arm", "pendulum")
_BINS = 12
_BLOCK = 0.25  # s, several times what the filter remembers


@dataclass(frozen=True)
class Map:
    """Missing torque on a row against a variable: edges (m + 1,) of its bins, mean (m,) and std (m,) of the torque."""

    row: str
    variable: Variable
    edges: Array
    mean: Array
    std: Array

    def to_dict(self) -> dict[str, Any]:
        arrays = {"edges": self.edges, "mean": self.mean, "std": self.std}
        return {"row": self.row, "variable": self.variable} | {k: a.tolist() for k, a in arrays.items()}


def variable(signals: Signals, name: Variable) -> Array:
    """(N,) values of one of `VARIABLES`; the pendulum's angle within half a turn of upright."""
    q2 = np.arctan2(np.sin(signals.q[:, 1]), np.cos(signals.q[:, 1]))
    columns = (signals.q[:, 0], signals.v[:, 0], q2, signals.v[:, 1], signals.u, signals.t)
    return columns[VARIABLES.index(name)]


def torque_map(paths: Sequence[FilterPath], row: int, name: Variable) -> Map:
    """The map of a row (0 arm, 1 pendulum) over several logs; bins hold equal shares of the samples."""
    signals = [Signals.of(path) for path in paths]
    values = [variable(s, name) for s in signals]
    edges = np.unique(np.quantile(np.concatenate(values), np.linspace(0.0, 1.0, _BINS + 1)))
    if len(edges) < 2:
        edges = np.array([edges[0] - 0.5, edges[0] + 0.5])
    m = len(edges) - 1
    gram, right, found, blocks = np.zeros((m, m)), np.zeros(m), [], 0
    for path, z in zip(paths, values, strict=True):
        at = np.clip(np.searchsorted(edges, z, side="right") - 1, 0, m - 1)
        torque = np.zeros((len(z), 2, m))
        torque[np.arange(len(z)), row, at] = 1.0
        D = answers(path, Columns(torque=torque))
        w = whiten(path.e, path.S).ravel()
        gram += D.T @ D
        right -= D.T @ w
        found.append((path, D, w))
    inverse = np.linalg.pinv(gram, rcond=1e-10, hermitian=True)
    mean = inverse @ right
    meat = np.zeros((m, m))
    for path, D, w in found:
        left = D * (w + D @ mean)[:, None]
        block = np.repeat(((path.record.t - path.record.t[0]) / _BLOCK).astype(int), 2)
        sums = np.stack([np.bincount(block, left[:, j]) for j in range(m)])
        meat += sums @ sums.T
        blocks += sums.shape[1]
    # a sandwich of few blocks is too narrow: pay for the fitted bins, and never below what white innovations give
    meat *= blocks / max(blocks - m, 1)
    variance = np.maximum(np.diag(inverse @ meat @ inverse), np.diag(inverse))
    return Map(ROWS[row], name, edges, mean, np.sqrt(variance))
