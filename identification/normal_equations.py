"""Normal equations A x = b of least squares, A = DᵀD: solved, inverted and weighed with the same scaling everywhere.

Parameters differ by orders of magnitude, and so do the columns of D. Rows and columns of A are therefore divided by the
roots of its diagonal, which is the same as to give every column of D the length one; what is small then is a direction
that the data do not show, and not a small unit (van der Sluis 1969). Cuts and floors below are of that scaled matrix.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

_LEAST = 1e-300  # of a diagonal: a column of zeros stays zeros


class Solved(NamedTuple):
    """x (m,), and how many directions of it the data determine; along the others the scaled x is zero."""

    solution: Array
    rank: int


class Gained(NamedTuple):
    """½ bᵀ A⁻¹ b, half of what the columns take from the sum of squares, and in how many directions."""

    gain: float
    rank: int


@dataclass(frozen=True)
class ScaledGram:
    """A symmetric matrix that is not negative, as matrix (m, m) with a diagonal of ones, and scale (m,).

    The matrix that was given is `matrix` times the outer product of `scale` with itself.
    """

    matrix: Array
    scale: Array

    @classmethod
    def of(cls, gram: ArrayLike, least: float = _LEAST) -> ScaledGram:
        """From A (m, m). Diagonals below `least` are scaled as `least`. Raises ValueError on other shapes."""
        A = np.asarray(gram, dtype=float)
        if A.ndim != 2 or A.shape[0] != A.shape[1]:
            raise ValueError(f"normal equations need a square matrix, got shape {A.shape}; give DᵀD, not D")
        scale = np.sqrt(np.maximum(np.diag(A), least))
        return cls(A / np.outer(scale, scale), scale)

    @cached_property
    def _eigen(self) -> tuple[Array, Array]:
        values, vectors = np.linalg.eigh(self.matrix)
        return values, vectors

    @property
    def values(self) -> Array:
        """Eigenvalues (m,) of the scaled matrix, rising."""
        return self._eigen[0]

    @property
    def vectors(self) -> Array:
        """Eigenvectors (m, m) of the scaled matrix, as columns."""
        return self._eigen[1]

    def kept(self, cut: float) -> NDArray[np.bool_]:
        """Which eigenvalues (m,) lie above the share `cut` of the largest."""
        return self.values > cut * max(float(self.values.max(initial=0.0)), _LEAST)

    def along(self, right: Array) -> Array:
        """b (m,), scaled, along each eigenvector (m,)."""
        if right.shape != self.scale.shape:
            raise ValueError(f"the right side must have shape {self.scale.shape} like the matrix, got {right.shape}")
        return self.vectors.T @ (right / self.scale)

    def back(self, coefficients: Array) -> Array:
        """x (m,) in the caller's units from coefficients (m,) of the eigenvectors."""
        return self.vectors @ coefficients / self.scale

    def solve(self, right: Array, cut: float) -> Solved:
        """x of A x = b (m,), of least scaled length where directions fall under the share `cut`."""
        if right.shape != self.scale.shape:
            raise ValueError(f"the right side must have shape {self.scale.shape} like the matrix, got {right.shape}")
        kept = self.kept(cut)
        V = self.vectors[:, kept]
        return Solved(V @ ((V.T @ (right / self.scale)) / self.values[kept]) / self.scale, int(kept.sum()))

    def gain(self, right: Array, cut: float) -> Gained:
        """½ bᵀ A⁻¹ b over the directions above the share `cut`: nats, where the rows of D are whitened."""
        along, kept = self.along(right), self.kept(cut)
        return Gained(0.5 * float(np.sum(along[kept] ** 2 / self.values[kept])), int(kept.sum()))

    def inverse(self, floor: float) -> Array:
        """A⁻¹ (m, m) with eigenvalues of at least `floor`: what the data do not show gets a huge, finite variance."""
        values = np.maximum(self.values, floor)
        return (self.vectors / values) @ self.vectors.T / np.outer(self.scale, self.scale)
