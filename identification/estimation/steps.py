"""A descent's steps, bent where parameters imitate each other along a curve.

The pendulum's row has no input, so its numbers share a scale that only the reaction on the arm fixes. Logarithms of
θ2 … θ5 move along that scale on a straight line. Friction may be zero and so is no logarithm: its way is bent.

And an effect may be a sum of fixed functions whose coefficients its parameters make up. A cable's torque is a cubic
in the angle, but its stiffness, softest place and stiffening are not the cubic's coefficients. Where the arm stays far
from the softest place they imitate each other: the likelihood has a narrow valley that curves, and a straight step
leaves it after a hundredth of the way. The readings answer linearly to the coefficients, so a step that is straight in
those stays in the valley.
"""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from furuta_gym.plant import Plant
from furuta_gym.plant.effects.declaration import EffectType

from ..kalman.coordinates import Coordinate
from .identifiability import PENDULUM

Array = NDArray[np.float64]

_DIFFERENCE = 1e-6  # of a coordinate, for the coefficients' derivatives
_INSIDE = 1e-9  # of a coordinate: a search between bounds must not start on one
_EXACT = 1e-10  # tolerances of that search
_SEARCH = 50  # evaluations of it
_FACTOR = 1.0  # of a logarithm at most: straight in the value, a step would lead below zero
_REFERENCE = "theta4"
_SQUARED = "torque_noise2"  # its intensity goes with the square of the scale


@dataclass(frozen=True)
class CommonScale:
    """The common scale of the pendulum's row among the coordinates of a fit.

    reference: position of ln θ4, whose change is that of the scale's logarithm. values: positions of what goes with
    the scale and is no logarithm. rates (n,): d z / d ln scale of the logarithms, zero elsewhere.
    """

    reference: int
    values: NDArray[np.int64]
    rates: Array

    @classmethod
    def among(cls, plant: Plant, coordinates: Sequence[Coordinate]) -> CommonScale | None:
        """None where θ4 is not free."""
        index = {c.name: i for i, c in enumerate(coordinates)}
        if _REFERENCE not in index or not coordinates[index[_REFERENCE]].log:
            return None
        scaled = [*PENDULUM, *(f"{e.name}.{p.name}" for e in plant.effects for p in e.type.parameters if p.scales)]
        free = [index[name] for name in scaled if name in index]
        rates = np.zeros(len(coordinates))
        rates[[i for i in free if coordinates[i].log]] = 1.0
        if _SQUARED in index:
            rates[index[_SQUARED]] = 2.0
        return cls(index[_REFERENCE], np.array([i for i in free if not coordinates[i].log], dtype=np.int64), rates)

    def axes(self, z: Array) -> Array:
        """(n, n), in columns: the common scale in place of ln θ4, and every other coordinate by itself."""
        axes = np.eye(len(z))
        axes[:, self.reference] = self.rates
        axes[self.values, self.reference] = z[self.values]
        return axes

    def bent(self, z: Array, straight: Array) -> Array:
        """Where a step from z (n,) ends whose straight end is `straight` (n,).

        What goes with the scale keeps the change relative to the scale that the straight step has to first order; what
        the straight step leaves where it is stays there."""
        change, own = straight[self.reference] - z[self.reference], self.values
        end = straight.copy()
        bent = (straight[own] - change * z[own]) * np.exp(change)
        end[own] = np.where(straight[own] == z[own], z[own], bent)
        return end


@dataclass(frozen=True)
class LinearEffect:
    """An effect that is declared `linear`, among the coordinates of a fit.

    given: values of the parameters of `linear`, for those that are not free. free: coordinates of the others, by name.
    solved: which of these a bent step solves for. The others, places of a kink, go straight.
    """

    type: EffectType
    given: dict[str, float]
    free: dict[str, Coordinate]
    index: dict[str, int]
    solved: tuple[str, ...]

    @classmethod
    def among(cls, plant: Plant, coordinates: Sequence[Coordinate]) -> list[LinearEffect]:
        """Those of a plant's effects of which a step can be bent: two parameters or more are solved for."""
        found = []
        for effect in plant.effects:
            if effect.type.linear is None:
                continue
            names = tuple(inspect.signature(effect.type.linear).parameters)
            full = {f"{effect.name}.{name}": name for name in names}
            index = {full[c.name]: i for i, c in enumerate(coordinates) if c.name in full}
            spanned = {p.name for p in effect.type.parameters if p.role == "size" or p.span == "linear"}
            solved = tuple(name for name in index if name in spanned)
            if len(solved) > 1:
                given = {name: effect.parameters[name] for name in names}
                free = {name: coordinates[i] for name, i in index.items()}
                found.append(cls(effect.type, given, free, index, solved))
        return found

    def bent(self, z: Array, straight: Array, information: Array) -> Array:
        """Where a step from z (n,) ends whose straight end is `straight` (n,), within the bounds.

        The coefficients change by what the straight step changes them by to first order. Where bounds forbid that,
        they come as near as they can by `information` (n, n), the curvature of the objective at z. What the straight
        step leaves where it is stays there: it is held, by a bound or by a profile.
        """
        every = list(self.index.values())
        moving = [name for name in self.solved if straight[self.index[name]] != z[self.index[name]]]
        own = [self.index[name] for name in moving]
        if len(own) < 2:
            return straight
        wanted = self._coefficients(z) + self._slopes(z, self.index) @ (straight - z)[every]
        # what a miss of the coefficients costs: as much as of the parameters that make it up
        values, vectors = np.linalg.eigh(information[np.ix_(own, own)])
        weight = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T @ np.linalg.pinv(self._slopes(z, moving))
        low, high = np.array([self.free[name].z_bounds for name in moving]).T
        positive = np.array([self.free[name].log for name in moving])
        low = np.where(positive, np.maximum(low, z[own] - _FACTOR), low)
        high = np.where(positive, np.minimum(high, z[own] + _FACTOR), high)
        end = straight.copy()

        def misses(x: Array) -> Array:
            end[own] = x
            return weight @ (self._coefficients(end) - wanted)

        first = np.clip(straight[own], low + _INSIDE, high - _INSIDE)
        tolerances = dict.fromkeys(("xtol", "ftol", "gtol"), _EXACT)
        end[own] = least_squares(misses, first, bounds=(low, high), max_nfev=_SEARCH, **tolerances).x
        return end

    def _coefficients(self, z: Array) -> Array:
        values = {name: c.to_value(z[self.index[name]]) for name, c in self.free.items()}
        return np.array(self.type.coefficients(self.given | values))

    def _slopes(self, z: Array, names: Sequence[str] | dict[str, int]) -> Array:
        columns = []
        for name in names:
            h = np.zeros(len(z))
            h[self.index[name]] = _DIFFERENCE
            columns.append((self._coefficients(z + h) - self._coefficients(z - h)) / (2.0 * _DIFFERENCE))
        return np.array(columns).T
