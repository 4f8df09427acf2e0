"""The estimator's coordinates: which numbers are free, on what scale, and how they fill a bank of filters."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import THETA_NAMES, Plant

NOISE_NAMES = ("torque_noise1", "torque_noise2", "reading_noise1", "reading_noise2")


@dataclass(frozen=True)
class Coordinate:
    """One free number. `log` works on its logarithm (it stays positive), else on value / scale.

    row: its row in P, or the index of the noise; low, high: bounds of the value; step: difference used for
    derivatives, in the coordinate; prior: (mean, std) of the value, or None.
    """

    name: str
    row: int
    log: bool
    scale: float = 1.0
    low: float = -math.inf
    high: float = math.inf
    step: float = 1e-4
    noise: bool = False
    prior: tuple[float, float] | None = None

    def to_value(self, z: float) -> float:
        return math.exp(min(z, 700.0)) if self.log else z * self.scale

    def to_z(self, value: float) -> float:
        return math.log(value) if self.log else value / self.scale

    @property
    def z_bounds(self) -> tuple[float, float]:
        if self.log:
            return (math.log(self.low) if self.low > 0 else -60.0), (math.log(self.high) if self.high < 1e300 else 60.0)
        return self.low / self.scale, self.high / self.scale

    def slope(self, z: float) -> float:
        """d value / d z."""
        return self.to_value(z) if self.log else self.scale


def plant_coordinates(
    plant: Plant,
    fixed: Sequence[str] = (),
    priors: Mapping[str, tuple[float, float]] | None = None,
    free_sharpness: bool = True,
    negative_friction: bool = False,
) -> list[Coordinate]:
    """Coordinates of θ, r and the parameters of the plant's effects, those of `fixed` left out.

    Inertias, θ5 and r are positive: their logarithms. θ3 keeps the sign it starts with. Friction is linear, so that
    it can be zero, and not negative unless asked for. Names are theta1 … theta9, r (or r1, r2), effect.parameter.
    """
    priors = dict(priors or {})
    level = float(abs(plant.theta[7]) + 1e-3 * abs(plant.theta[4]))
    coordinates = []
    for i, name in enumerate(THETA_NAMES):
        if i < 5:
            if plant.theta[i] > 0:
                coordinates.append(Coordinate(name, i, log=True))
            else:
                coordinates.append(Coordinate(name, i, log=False, scale=float(abs(plant.theta[i]) + 1e-9)))
        else:
            scale = float(max(abs(plant.theta[i]), 1e-2 * level))
            low = -math.inf if negative_friction else 0.0
            coordinates.append(Coordinate(name, i, log=False, scale=scale, low=low, step=1e-3))
    if free_sharpness:
        if isinstance(plant.friction_sharpness, tuple):
            coordinates += [Coordinate(f"r{i + 1}", 9 + i, log=True, low=1.0, high=1e4, step=1e-3) for i in range(2)]
        else:
            coordinates.append(Coordinate("r", 9, log=True, low=1.0, high=1e4, step=1e-3))
    row = 11
    for effect in plant.effects:
        for p in effect.type.parameters:
            coordinates.append(_effect_coordinate(plant, effect.name, p, row))
            row += 1
    known = {c.name for c in coordinates} | {"r"}
    if strange := (set(fixed) | set(priors)) - known:
        raise ValueError(f"cannot fix or put a prior on {sorted(strange)}; free parameters are {sorted(known)}")
    kept = [c for c in coordinates if c.name not in fixed and math.isfinite(plant.packed().p[c.row])]
    return [_with_prior(c, priors.get(c.name)) for c in kept if c.name.split(".")[-1] != "n" or "ripple" not in c.name]


def _effect_coordinate(plant: Plant, effect: str, p, row: int) -> Coordinate:
    default = plant.default_effect(effect).parameters[p.name]
    scale = max(abs(default), 1e-12)
    if p.role == "shape" and p.lower > 0:
        return Coordinate(f"{effect}.{p.name}", row, log=True, low=p.lower, high=p.upper, step=1e-3)
    return Coordinate(f"{effect}.{p.name}", row, log=False, scale=scale, low=p.lower, high=p.upper, step=1e-3)


def _with_prior(c: Coordinate, prior: tuple[float, float] | None) -> Coordinate:
    if prior is None:
        return c
    mean, std = prior
    if not (math.isfinite(mean) and std > 0):
        raise ValueError(f"a prior is mean ± standard deviation > 0, got {mean:g} ± {std:g} for {c.name}")
    return Coordinate(**{**c.__dict__, "prior": (float(mean), float(std))})


def noise_coordinates() -> list[Coordinate]:
    """Torque noise intensities of the two rows, and scale factors on the variances of the two readings."""
    return [
        Coordinate(name, i, log=True, low=1e-22 if i < 2 else 0.05, high=1e6 if i < 2 else 1e4, step=1e-3, noise=True)
        for i, name in enumerate(NOISE_NAMES)
    ]


def fill(
    coordinates: Sequence[Coordinate], z: NDArray[np.float64], p: NDArray[np.float64], noise: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """p and noise (both copied) with the coordinates' values in place; a single r sets both axes."""
    p, noise = p.copy(), noise.copy()
    for c, zi in zip(coordinates, z, strict=True):
        if c.noise:
            noise[c.row] = c.to_value(zi)
        else:
            p[c.row] = c.to_value(zi)
            if c.name == "r":
                p[10] = p[9]
    return p, noise
