"""Priors on the coordinates of a fit, and the limits of a rigid body."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import THETA_NAMES

from ..kalman.coordinates import Coordinate, filled_parameters

Array = NDArray[np.float64]

_STIFF = 1e-4  # relative tolerance of the rigid-body limits
_LEAST = 1e-12  # of an entry of θ that another value is compared with


@dataclass(frozen=True, eq=False)
class Priors:
    """Priors of coordinates, in nats. p: the plant's packed parameters, for what is not free. physical: penalise what
    no rigid body has."""

    coordinates: tuple[Coordinate, ...]
    p: Array
    physical: bool

    def at(self, z: Array) -> tuple[float, Array, Array]:
        """The cost at z (n,), its gradient (n,) and curvature (n, n)."""
        value, gradient, information = 0.0, np.zeros(len(z)), np.zeros((len(z), len(z)))
        for r, slopes in self._residuals(z) + (self._rigid_body(z) if self.physical else []):
            value += 0.5 * r * r
            gradient += r * slopes
            information += np.outer(slopes, slopes)
        return value, gradient, information

    def of_rigid_body(self, z: Array) -> Array:
        """The curvature (n, n) of the rigid body's limits at z (n,). It is no information: where a limit holds, the
        data still say as much of θ as they do without it."""
        information = np.zeros((len(z), len(z)))
        for _, slopes in self._rigid_body(z) if self.physical else []:
            information += np.outer(slopes, slopes)
        return information

    def _residuals(self, z: Array) -> list[tuple[float, Array]]:
        """Residuals in standard deviations, and their slopes."""
        found = []
        for i, (c, zi) in enumerate(zip(self.coordinates, z, strict=True)):
            if c.prior is not None:
                found.append(((c.to_value(zi) - c.prior[0]) / c.prior[1], self._one(i, c.slope(zi) / c.prior[1])))
            if c.weak_prior is not None:
                centre, std = c.weak_prior
                slopes = self._one(i, 1.0 / std)
                if c.relative_to:
                    theta, of, slope = self._theta(z, c.relative_to)
                    centre += math.log(max(theta, _LEAST))
                    if of is not None and theta > _LEAST:
                        slopes[of] -= slope / theta / std
                found.append(((zi - centre) / std, slopes))
        return found

    def _one(self, i: int, slope: float) -> Array:
        slopes = np.zeros(len(self.coordinates))
        slopes[i] = slope
        return slopes

    def _theta(self, z: Array, name: str) -> tuple[float, int | None, float]:
        """An entry of θ at z, its coordinate where it is free, and the slope in that."""
        for i, c in enumerate(self.coordinates):
            if c.name == name:
                return c.to_value(z[i]), i, c.slope(z[i])
        return float(self.p[THETA_NAMES.index(name)]), None, 0.0

    def _rigid_body(self, z: Array) -> list[tuple[float, Array]]:
        """Residuals and slopes that hold J1 = θ1 − θ3²/θ2 and J2 = θ4 − θ2 above a thousandth of θ1 and θ4."""

        def lacks(z: Array) -> Array:
            th = filled_parameters(self.coordinates, z, self.p)
            return np.array([1.001 * th[2] ** 2 / (th[0] * th[1]) - 1.0, 1.001 * th[1] / th[3] - 1.0]) / _STIFF

        r = lacks(z)
        if (r <= 0).all():
            return []
        slopes = np.zeros((2, len(z)))
        for i, c in enumerate(self.coordinates):
            if c.of_plant and c.row < 4:
                step = np.zeros(len(z))
                step[i] = 1e-7
                slopes[:, i] = (lacks(z + step) - lacks(z - step)) / 2e-7
        return [(float(r[k]), slopes[k]) for k in range(2) if r[k] > 0]
