"""Are the parameters the same all along a log? The Nyblom–Hansen test, from scores sample by sample.

Under a right model the scores of an estimate are uncorrelated in time, so their running sum is a Brownian bridge; a
parameter that drifts or steps bends it (Nyblom 1989, Hansen 1992).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_BLOCKS = 8  # stretches of time in which a parameter may be another


@dataclass(frozen=True)
class Constancy:
    """p (n,) of each parameter, `joint_p` of all; moved (blocks, n): first-order estimate of how far each parameter
    lies from its mean in equal stretches of time."""

    names: tuple[str, ...]
    p: Array
    joint_p: float
    moved: Array


def constancy(answers: Array, innovations: Array, names: Sequence[str]) -> Constancy:
    """From the answers (N, 2, n) of whitened innovations (N, 2) to each parameter.

    Parameters are taken apart: each score is what is left of it after the others (efficient scores), so that one that
    moves does not drag its neighbours along.
    """
    scores = -np.einsum("kan,ka->kn", answers, innovations)
    flat = answers.reshape(-1, answers.shape[2])
    gram = flat.T @ flat
    inverse = np.linalg.pinv(gram, rcond=1e-10, hermitian=True)
    influence = scores @ inverse
    influence = influence - influence.mean(axis=0)
    n = len(influence)
    path = np.cumsum(influence, axis=0)
    variance = np.maximum(np.sum(influence**2, axis=0), 1e-300)
    statistic = np.sum(path**2, axis=0) / (n * variance)
    together = np.linalg.pinv(influence.T @ influence, rcond=1e-10, hermitian=True)
    joint = float(np.einsum("ki,ij,kj->", path, together, path)) / n
    rank = int(np.linalg.matrix_rank(influence.T @ influence / np.sqrt(np.outer(variance, variance)), tol=1e-8))
    moved = np.zeros((_BLOCKS, len(names)))
    for b, part in enumerate(np.array_split(np.arange(n), _BLOCKS)):
        rows = answers[part].reshape(-1, answers.shape[2])
        local = np.linalg.pinv(rows.T @ rows, rcond=1e-8, hermitian=True)
        moved[b] = local @ scores[part].sum(axis=0)
    p = np.array([tail(x, 1) for x in statistic])
    return Constancy(tuple(names), p, tail(joint, max(rank, 1)), moved)


def tail(x: float, dimension: int) -> float:
    """P(∫ BᵀB > x) for a Brownian bridge B of some dimensions: a sum of χ² with weights 1/(π j)² (Imhof 1961).

    Good to about 1e-5, and zero below.
    """
    j = np.arange(1, 61)
    weights = 1.0 / (np.pi * j) ** 2
    rest = 1.0 / 6.0 - weights.sum()  # of the weights beyond, which act to first order
    u = np.linspace(1e-6, 1500.0, 15_001)
    angle = 0.5 * (dimension * rest - x) * u
    damping = np.zeros_like(u)
    for w in weights:
        angle += 0.5 * dimension * np.arctan(w * u)
        damping += 0.25 * dimension * np.log1p((w * u) ** 2)
    value = np.sin(angle) / (u * np.exp(damping))
    return float(np.clip(0.5 + np.trapezoid(value, u) / np.pi, 0.0, 1.0))
