"""How the innovations of a filter answer to torques and reading errors, and what combination of them explains most.

Along a kept path the answer is linear: regressing the whitened innovations on the answers of a family of functions is
generalised least squares with the noise model in place, so that the residuals are white and the χ² is honest.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant.compiled import compiled

from ..kalman.likelihood import whiten
from ..kalman.path import FilterPath
from ..normal_equations import ScaledGram
from .basis import Columns

Array = NDArray[np.float64]

PRECISIONS = 10.0 ** np.arange(-6.0, 4.0, 0.5)
"""Precisions of a common prior on coefficients that are tried, over the size of the data's own."""


def answers(path: FilterPath, columns: Columns) -> Array:
    """Whitened answer (2 N, m) of the innovations to each of some columns."""
    n = path.states
    none = np.zeros((0, 2, columns.size))
    torque = none if columns.torque is None else np.ascontiguousarray(columns.torque)
    misreading = none if columns.misreading is None else np.ascontiguousarray(columns.misreading)
    out = np.zeros((len(path.e), 2, columns.size))
    kept = (path.transition[:, :n, :n], path.push[:, :n], path.reading[:, :, :n], path.gain[:, :n])
    _answers(*(np.ascontiguousarray(a) for a in kept), path.used, torque, misreading, out)
    return whiten(out, path.S).reshape(-1, columns.size)


def _side_by_side(found: Sequence[Columns]) -> Iterator[Columns]:
    """The columns with neighbours of one kind joined, in the same order: a pass over a log costs little more for many
    columns than for a few."""
    for _, group in groupby(found, lambda columns: (columns.torque is None, columns.misreading is None)):
        every = list(group)
        torque = _joined([columns.torque for columns in every])
        misreading = _joined([columns.misreading for columns in every])
        yield Columns(torque=torque, misreading=misreading)


def _joined(columns: Sequence[Array | None]) -> Array | None:
    given = [c for c in columns if c is not None]
    return np.concatenate(given, axis=2) if given else None


@dataclass(frozen=True)
class Normal:
    """Normal equations of a regression of whitened innovations: gram (m, m), right (m,), and Σ w²."""

    gram: Array
    right: Array
    square: float

    @classmethod
    def of(cls, path: FilterPath, found: Sequence[Columns]) -> Normal:
        return cls.of_columns(path, [answers(path, family) for family in _side_by_side(found)])

    @classmethod
    def of_columns(cls, path: FilterPath, columns: Sequence[Array]) -> Normal:
        """Of whitened answers (2 N, m), side by side."""
        D = np.concatenate(columns, axis=1)
        w = whiten(path.e, path.S).ravel()
        return cls(D.T @ D, -D.T @ w, float(w @ w))

    @classmethod
    def together(cls, found: Iterable[Normal]) -> Normal:
        """Of the data of all of them, one at least."""
        first, *others = found
        return cls(
            sum((n.gram for n in others), first.gram),
            sum((n.right for n in others), first.right),
            sum((n.square for n in others), first.square),
        )


@dataclass(frozen=True)
class Solution:
    """Coefficients (m,) under a common prior on the normalised columns, the precision of which the data chose.

    evidence [nats]: log of how much more likely the data are than with nothing added, the freedom paid for.
    leverage (m,): share of each coefficient that the data decided; its sum is the number of parameters used.
    """

    coefficients: Array
    evidence: float
    leverage: Array


def solve(normal: Normal) -> Solution:
    """The most likely combination: ridge regression with the precision of largest evidence (MacKay 1992)."""
    scaled = ScaledGram.of(normal.gram)
    g = np.maximum(scaled.values, 0.0)
    along = scaled.along(normal.right)
    precision, evidence = most_likely_precision(g, along, PRECISIONS * len(g))
    return Solution(scaled.back(along / (g + precision)), evidence, scaled.vectors**2 @ (g / (g + precision)))


def most_likely_precision(g: Array, along: Array, tried: Array) -> tuple[float, float]:
    """The precision of a common prior, of those tried, that makes the data most likely, and its evidence [nats].

    g, along (m,): eigenvalues of the normal equations, and the right-hand side along their eigenvectors.
    """
    evidence = [0.5 * float(np.sum(along**2 / (g + p) - np.log1p(g / p))) for p in tried]
    best = int(np.argmax(evidence))
    return float(tried[best]), evidence[best]


@compiled(nogil=True)
def _answers(Phi, push, H, K, used, torque, misreading, out):
    N, n, m = Phi.shape[0], Phi.shape[1], out.shape[2]
    s, moved = np.zeros((n, m)), np.zeros((n, m))
    for k in range(N):
        if used[k, 0] or used[k, 1]:
            for a in range(2):
                if not used[k, a]:
                    continue
                for j in range(m):
                    out[k, a, j] = -misreading[k, a, j] if misreading.shape[0] == N else 0.0
                for i in range(n):
                    h = H[k, a, i]
                    if h != 0.0:
                        for j in range(m):
                            out[k, a, j] -= h * s[i, j]
            for i in range(n):
                for j in range(m):
                    s[i, j] += K[k, i, 0] * out[k, 0, j] + K[k, i, 1] * out[k, 1, j]
        for i in range(n):
            for j in range(m):
                moved[i, j] = 0.0
            for r in range(n):
                p = Phi[k, i, r]
                for j in range(m):
                    moved[i, j] += p * s[r, j]
            if torque.shape[0] == N:
                for a in range(2):
                    b = push[k, i, a]
                    for j in range(m):
                        moved[i, j] += b * torque[k, a, j]
        s, moved = moved, s
