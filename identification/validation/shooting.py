"""A second witness for the parameters: multiple shooting with a robust loss.

The prediction-error method explains what a model misses as torque noise, step by step, and a wrong structure then has
parameters that predict badly over a second. Here the plant runs freely over windows of some tenths of a second from
smoothed states, without any torque noise, and the errors are weighed by Huber's loss. Where nothing is missing both
methods agree within their errors; this one is the less precise then.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from furuta_gym.plant import Plant

from ..estimation.pool import mapped, one_blas_thread, shared_pool
from ..estimation.zeros import moved
from ..kalman.coordinates import Coordinate, Zeros, filled_plant, plant_coordinates
from ..kalman.noise import fit_noise
from ..kalman.path import FilterPath, follow, smooth
from ..kalman.record import Record, stretches
from ..logs.log import Log, as_logs
from .free_run import Windows, free_run

HORIZONS = (0.1, 0.2, 0.35, 0.5)
"""Seconds after a window's start at which it is compared."""
_SETTLE = 0.3  # s
_HUBER = 1.5  # standard deviations, from which an error counts linearly
_ROUNDS, _TRIES = 3, 12  # of smoothing anew, and of the descent in each
_LOST = 1e3  # standard deviations, for a run that leaves all bounds
_BLOCK = 1.0  # s: errors nearer than that are not independent

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Shooting:
    """A plant fitted by multiple shooting: names and values of what was free, standard deviations by blocks of time
    (an estimate that holds for a wrong model, too), and whether the descent converged."""

    plant: Plant
    names: tuple[str, ...]
    values: Array
    std: Array
    converged: bool


@one_blas_thread
def shooting(plant: Plant, logs: Log | Sequence[Log], zeros: Zeros | None = None) -> Shooting:
    """θ and the parameters of the plant's effects, from the plant's own values, by multiple shooting.

    zeros: of the logs' encoders. Raises ValueError where no log is long enough or the filter loses them.
    """
    logs = moved(as_logs(logs), zeros or {})
    records = [s.record for s in stretches(logs) if s.record.duration > _SETTLE + 4 * HORIZONS[-1]]
    if not records:
        raise ValueError(f"no log is long enough: multiple shooting needs {_SETTLE + 4 * HORIZONS[-1]:g} s")
    coordinates = plant_coordinates(plant, free_sharpness=False)
    z = np.array([c.to_z(float(plant.packed().p[c.row])) for c in coordinates])
    problem = _Problem(plant, coordinates, records, z)
    converged = False
    for _ in range(_ROUNDS):
        found = least_squares(
            problem.errors,
            z,
            jac=problem.jacobian,  # type: ignore[arg-type]
            bounds=problem.bounds,
            x_scale="jac",
            loss="huber",
            f_scale=_HUBER,
            max_nfev=_TRIES,
            ftol=1e-4,
        )
        small = np.abs(found.x - z).max() < 1e-3
        z, converged = found.x, bool(found.status > 0)
        if small:
            break
        problem = _Problem(plant, coordinates, records, z)
    values = np.array([c.to_value(zi) for c, zi in zip(coordinates, z, strict=True)])
    slopes = np.array([c.slope(zi) for c, zi in zip(coordinates, z, strict=True)])
    std = slopes * np.sqrt(np.maximum(np.diag(problem.covariance(z)), 0.0))
    names = tuple(c.name for c in coordinates)
    fitted = filled_plant(plant, coordinates, z).without_fit()
    return Shooting(_with_errors(fitted, names, std), names, values, std, converged)


def _with_errors(plant: Plant, names: Sequence[str], std: Array) -> Plant:
    """The plant with the standard deviations of its effects' parameters; those of an earlier fit are not its own."""
    found = {name: float(s) for name, s in zip(names, std, strict=True) if np.isfinite(s)}
    own = [{p: found[f"{e.name}.{p}"] for p in e.parameters if f"{e.name}.{p}" in found} for e in plant.effects]
    return plant.replace(effects=tuple(replace(e, std=s) for e, s in zip(plant.effects, own, strict=True)))


class _Problem:
    """Errors of free runs from states that are smoothed under the plant at z0, over their size there."""

    def __init__(self, plant: Plant, coordinates: Sequence[Coordinate], records: Sequence[Record], z0: Array) -> None:
        self.plant, self.coordinates, self.records = plant, coordinates, records
        low, high = np.array([c.z_bounds for c in coordinates]).T
        self.bounds = low, high
        start = filled_plant(plant, coordinates, z0)
        self.paths = [_smoothed(start, record) for record in records]
        self.windows = [Windows.over(r.t, HORIZONS, _SETTLE, per_horizon=2) for r in records]
        spread = [free_run(path, w) for path, w in zip(self.paths, self.windows, strict=True)]
        size = 1.4826 * np.median(np.abs(np.concatenate(spread)), axis=0)  # (J, 2), of a normal distribution
        self.size = np.maximum(size, np.sqrt(np.mean([r.variance for r in records], axis=0)))
        self.block = _blocks(records, self.windows, self.size.size)

    def errors(self, z: Array) -> Array:
        try:
            plant = filled_plant(self.plant, self.coordinates, z)
        except ValueError:  # no plant: as bad as a run that is lost
            return np.full(self.block.size, _LOST)
        runs = [free_run(replace(path, plant=plant), w) for path, w in zip(self.paths, self.windows, strict=True)]
        return np.clip((np.concatenate(runs) / self.size).ravel(), -_LOST, _LOST)

    def errors_of_own_starts(self, z: Array) -> Array:
        """Errors from states that are smoothed under the plant at z itself, with the noise at z0; NaN for a record
        that the filter loses then, and where z makes no plant."""
        try:
            plant = filled_plant(self.plant, self.coordinates, z)
        except ValueError:
            return np.full(self.block.size, np.nan)
        own = [follow(plant, path.record, path.noise) for path in self.paths]
        runs = [
            np.full((len(w.starts), len(HORIZONS), 2), np.nan)
            if path is None
            else free_run(replace(path, filtered=smooth(path).mean), w)
            for path, w in zip(own, self.windows, strict=True)
        ]
        return np.clip((np.concatenate(runs) / self.size).ravel(), -_LOST, _LOST)

    def jacobian(self, z: Array) -> Array:
        return self.slopes(z, self.errors)

    def slopes(self, z: Array, errors: Callable[[Array], Array]) -> Array:
        """By differences."""
        steps = np.array([c.step for c in self.coordinates])
        steps = np.where(z + steps > self.bounds[1], -steps, steps)
        tried = np.repeat(z[None], len(z) + 1, axis=0)
        tried[np.arange(1, len(z) + 1), np.arange(len(z))] += steps
        base, *others = mapped(shared_pool(), errors, tried)
        return np.stack([(other - base) / step for other, step in zip(others, steps, strict=True)], axis=1)

    def covariance(self, z: Array) -> Array:
        """Of z, by the scores of blocks of time (White's sandwich): windows overlap, and a wrong model repeats its
        errors. A smoothed start goes along with z and hides a part of its error, so the bread has the slopes of
        starts that are smoothed under the tried plant."""
        J, e = self.jacobian(z), self.errors(z)
        weight = np.minimum(1.0, _HUBER / np.maximum(np.abs(e), 1e-12))
        scores = np.zeros((int(self.block.max()) + 1, len(z)))
        np.add.at(scores, self.block, (weight * e)[:, None] * J)
        inside = np.abs(e) < _HUBER
        own = self.slopes(z, self.errors_of_own_starts)[inside]
        bread = J[inside].T @ (own if np.isfinite(own).all() else J[inside])  # a start that is lost says nothing
        inverse = np.linalg.pinv(bread, rcond=1e-9)
        independent = sum(r.duration for r in self.records) / HORIZONS[-1]
        taken = independent / max(independent - len(z), 1.0)  # errors lose what the parameters take of them
        return taken * inverse @ (scores.T @ scores) @ inverse.T


def _smoothed(plant: Plant, record: Record) -> FilterPath:
    path = fit_noise(plant, record).path
    return replace(path, filtered=smooth(path).mean)


def _blocks(records: Sequence[Record], windows: Sequence[Windows], each: int) -> NDArray[np.int64]:
    """The block of time that every error belongs to, over all records."""
    found, first = [], 0
    for record, w in zip(records, windows, strict=True):
        own = ((record.t[w.starts] - record.t[0]) / _BLOCK).astype(np.int64)
        found.append(np.repeat(first + own, each))
        first += int(own.max()) + 1
    return np.concatenate(found)
