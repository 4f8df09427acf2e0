"""How much of a log is noise, for a plant whose parameters stay as they are: a fit of the intensities only.

Along a kept filter path the equations are linear, so one value of the likelihood is a pass of small matrices instead
of an integration. The path is followed anew when the intensities have moved.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import Plant

from .arguments import Assumed
from .bank import whole_registers
from .likelihood import innovation_cost
from .noise_kernels import differentiate_noise, run_bank
from .noise_model import READING, TORQUE, RecordNoise
from .path import FilterPath, follow
from .record import Record

_BANDWIDTHS = (30.0, 300.0)  # rad/s, of the filters that are tried first
_SHIFT = 1e-3  # of a coordinate, for derivatives
_PROMISED = 0.01  # of the tolerance: a smaller decrease of V is not looked for
_ROUNDS = 3  # of linearising and descending
_FACTOR_PRIOR = 0.5  # the readings' variances are known from the log itself within about this factor (log scale)


class LostLog(ValueError):
    """A plant that a log cannot be followed with."""


@dataclass(frozen=True)
class NoiseFit:
    """Intensities that make a log most likely for a plant, the filter's path under them, and V of that path."""

    path: FilterPath
    value: float

    @property
    def noise(self) -> RecordNoise:
        return self.path.noise


def fit_noise(plant: Plant, record: Record) -> NoiseFit:
    """Maximum-likelihood torque noise and reading variances of a plant on a record, all else held.

    Raises LostLog, a ValueError, if the filter loses the log.
    """
    base = unit_intensity(plant, record)
    path = None
    for bandwidth in _BANDWIDTHS:
        path = path or follow(plant, record, RecordNoise(base * bandwidth**4, record.variance))
    if path is None:
        raise LostLog(
            "the Kalman filter of this plant loses the log. The plant does not describe this rig: check signs, units "
            "and the pendulum's zero of the log, and that both are of the same device."
        )
    best, value = NoiseFit(path, innovation_cost(path.e, path.S)), math.inf
    for _ in range(_ROUNDS):
        path = follow(plant, record, *likeliest(path))
        if path is None:
            break
        before, value = value, innovation_cost(path.e, path.S)
        if value < best.value:
            best = NoiseFit(path, value)
        if abs(before - value) < 0.5:
            break
    return best


def unit_intensity(plant: Plant, record: Record) -> NDArray[np.float64]:
    """Torque intensities (2,) [{u}² s] under which a filter's bandwidth is 1 rad/s; it grows as their fourth root."""
    th = plant.theta
    inertia = np.array([th[0] - th[2] ** 2 / th[3], th[3] - th[2] ** 2 / th[0]])
    return record.variance * float(np.median(np.diff(record.t))) * inertia**2


def likeliest(
    path: FilterPath, used: NDArray[np.float64] | None = None, hold_noise: bool = False
) -> tuple[RecordNoise, NDArray | None]:
    """Noise and walk (2,) or None that minimise V on a linearised log, from those of the path.

    used (2,): number of parameters of torques on the two rows that were fitted to these data; the torque noise is
    estimated from what they left (restricted likelihood: about half of what lies along such a torque's answer is
    torque noise, the rest the readings'). hold_noise: let only the walk move.
    """
    problem = _Problem(path)
    if hold_noise:
        problem.low[:4] = problem.high[:4] = problem.start()[:4]
    z, information = _descend(problem)
    if used is not None:
        freedom = np.maximum(2.0 * np.diag(information)[:2], 1.0)  # of the torque noise: information on ln q is ν/2
        z[:2] -= np.log(np.clip(1.0 - 0.5 * used / freedom, 0.3, 1.0))
    return problem.unpack(z)


def _descend(problem: _Problem, iterations: int = 30, tolerance: float = 0.02) -> tuple[NDArray, NDArray]:
    """Levenberg–Marquardt whose steps are limited one by one: an intensity that goes to nothing is a flat direction
    of long steps, which must not hold up the others. Returns z and the Fisher information there."""
    z = problem.start()
    damping, quiet = 1e-3, 0
    expansion = problem.expand(z)
    for _ in range(iterations):
        before, g, H = expansion
        free = ~((z <= problem.low) & (g > 0) | (z >= problem.high) & (g < 0))
        while damping < 1e6:
            A = H[np.ix_(free, free)]
            step = np.zeros_like(z)
            step[free] = np.linalg.solve(A + damping * np.diag(np.diag(A) + 1e-9), -g[free])
            if -0.5 * float(g @ step) < _PROMISED * tolerance:
                return z, H
            trial = np.clip(z + np.clip(step, -2.0, 2.0), problem.low, problem.high)
            there = problem.expand(trial)  # most steps are taken, and then it is needed anyway
            if there[0] < before:
                break
            damping = max(10.0 * damping, 1e-3)
        else:
            break
        quiet = quiet + 1 if before - there[0] < tolerance else 0
        z, damping, expansion = trial, max(damping / 10.0, 1e-6), there
        if quiet == 2:
            break
    return z, expansion[2]


class _Problem:
    """V of the intensities along a path. z: ln(torque intensity / unit) of the two rows, ln of the factors on the
    readings' variances, then ln(walk / unit)."""

    def __init__(self, path: FilterPath) -> None:
        self.path, self.walk = path, path.walk is not None
        self.base = unit_intensity(path.plant, path.record)
        # from a filter slower than 0.03 rad/s, which only counts, to one that follows each reading
        self.low = np.array([-14.0] * 2 + [-3.0] * 2 + [-14.0] * 2)[: 6 if self.walk else 4]
        self.high = np.array([35.0] * 2 + [4.0] * 2 + [45.0] * 2)[: 6 if self.walk else 4]

    def start(self) -> NDArray[np.float64]:
        p = self.path
        z = [np.log(p.noise.torque / self.base), np.log(p.noise.variance / p.record.variance)]
        if p.walk is not None:
            z.append(np.log(np.maximum(p.walk, 1e-300) / self.base))
        return np.clip(np.concatenate(z), self.low, self.high)

    def unpack(self, z: NDArray[np.float64]) -> tuple[RecordNoise, NDArray[np.float64] | None]:
        noise = np.concatenate([self.base, self.path.record.variance]) * np.exp(z[:4])
        return RecordNoise(noise[TORQUE], noise[READING]), self.base * np.exp(z[4:]) if self.walk else None

    def _bank(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """e (N, 2, L) and S (N, 3, L) of the filters at points (L or less, n)."""
        lanes = whole_registers(len(points))
        unpacked = [self.unpack(z) for z in points] + [self.unpack(points[0])] * (lanes - len(points))
        noise = np.array([noise.packed() for noise, _ in unpacked]).T.copy()
        walk = np.array([[] if walk is None else walk for _, walk in unpacked]).T.copy()
        p = self.path
        C = np.repeat(p.first[:, :, None], lanes, axis=2)
        if self.walk:
            C[[-2, -1], [-2, -1]] = walk
        e, S = np.empty((len(p.e), 2, lanes)), np.empty((len(p.e), 3, lanes))
        run_bank(p.record.t, p.used, p.inertias, p.linearised, Assumed(C, noise, walk), e, S)
        return e, S

    def _prior(self, z: NDArray[np.float64]) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
        weight = np.zeros(len(z))
        weight[2:4] = 1.0 / _FACTOR_PRIOR**2
        return 0.5 * float(weight @ z**2), weight * z, np.diag(weight)

    def expand(self, z: NDArray[np.float64]) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
        """V, its gradient (n,) and Fisher information (n, n)."""
        step = np.where(z + _SHIFT > self.high, -_SHIFT, _SHIFT)
        e, S = self._bank(np.vstack([z, z + np.diag(step)]))
        g, information = np.zeros(len(z)), np.zeros((len(z), len(z)))
        value = differentiate_noise(e, S, step, g, information)
        prior = self._prior(z)
        return value + prior[0], g + prior[1], information + prior[2]
