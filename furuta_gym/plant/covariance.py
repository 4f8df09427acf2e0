"""Uncertainty of a plant's parameters: names and a covariance matrix."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from furuta_gym.declared import checked

from .parameters import THETA_NAMES, plain_numbers
from .plant_file import FIELDS, CovarianceEntry

NORMAL_95 = 1.959963984540054
"""Standard deviations to either side of the mean that hold 95 % of a normal distribution."""
_LARGEST = 1e100  # of a variance; beyond it products of two overflow


@dataclass(frozen=True, eq=False)
class Covariance:
    """Covariance (n, n) of the parameters `names`: theta1 …, r or r1/r2, and effect parameters as "effect.parameter".

    Raises ValueError when the matrix is not symmetric positive semi-definite or does not fit the names.
    """

    names: tuple[str, ...]
    matrix: NDArray[np.float64]

    def __post_init__(self) -> None:
        try:
            matrix = plain_numbers(self.matrix)
            names = tuple(str(name) for name in self.names)
        except (TypeError, ValueError, OverflowError):
            raise ValueError(f"covariance needs names and a square matrix of numbers, got {self.names!r}") from None
        if any(not isinstance(name, str) for name in self.names) or len(set(names)) != len(names):
            raise ValueError(f"the names of a covariance must be different words, got {list(self.names)}")
        n = len(names)
        if matrix.shape != (n, n) or not (np.abs(matrix) <= _LARGEST).all():
            raise ValueError(f"covariance of {n} parameters must be a finite {n}×{n} matrix, got {matrix.shape}")
        scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
        if np.any(np.diag(matrix) < 0) or np.any(np.abs(matrix - matrix.T) > 1e-6 * np.outer(scale, scale)):
            raise ValueError("covariance must be symmetric with a diagonal that is not negative")
        matrix = 0.5 * (matrix + matrix.T)
        if n and np.linalg.eigvalsh(matrix / np.outer(scale, scale)).min() < -1e-6:
            raise ValueError("covariance must be positive semi-definite")
        matrix.setflags(write=False)
        object.__setattr__(self, "names", names)
        object.__setattr__(self, "matrix", matrix)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Covariance) and self.to_dict() == other.to_dict()

    def __hash__(self) -> int:
        return hash(self.names)

    def without(self, *names: str) -> "Covariance":
        """The same over the other parameters."""
        kept = [i for i, name in enumerate(self.names) if name not in names]
        return Covariance(tuple(self.names[i] for i in kept), self.matrix[np.ix_(kept, kept)])

    def std_along(self, slopes: Mapping[str, float]) -> float:
        """Standard deviation of Σ slope · parameter, to first order that of a quantity with these derivatives. A
        parameter that is not estimated counts as known."""
        kept = [name for name in slopes if name in self.names]
        rows = [self.names.index(name) for name in kept]
        g = np.array([slopes[name] for name in kept])
        return float(np.sqrt(max(0.0, g @ self.matrix[np.ix_(rows, rows)] @ g)))

    def std_of(self, names: Iterable[str]) -> dict[str, float]:
        """Standard deviations of those of `names` that are estimated."""
        std = np.sqrt(np.diag(self.matrix))
        return {name: float(std[self.names.index(name)]) for name in names if name in self.names}

    def to_dict(self) -> dict[str, Any]:
        return {"names": list(self.names), "matrix": self.matrix.tolist()}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any] | list[list[float]]) -> "Covariance":
        """Names and matrix, or a bare 9×9 list over θ. Raises ValueError for anything else."""
        read: CovarianceEntry | list[list[float]] = checked(data, FIELDS["covariance"], "covariance")
        names, matrix = (read.names, read.matrix) if isinstance(read, CovarianceEntry) else (THETA_NAMES, read)
        return cls(tuple(names), matrix)  # type: ignore[arg-type]
