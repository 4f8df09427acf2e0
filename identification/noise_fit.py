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
from furuta_gym.plant.compiled import compiled
from furuta_gym.plant.dynamics import mass_matrix

from .filter_bank import _add_torque_noise, _gain, _propagate
from .filter_path import FilterPath, follow
from .prediction_error import _THREADS, Expansion, Record, _scores, _value

_BANDWIDTH = 30.0  # rad/s, of the filter that is tried first
_WANDER = 2.0  # rad/s, of the unknown torques at the start of their fit
_FACTOR_PRIOR = 0.5  # the readings' variances are known from the log itself within about this factor (log scale)


@dataclass(frozen=True)
class NoiseFit:
    """Intensities that make a log most likely for a plant, and the filter's path under them.

    value is V = ½ Σ (eᵀ S⁻¹ e + ln det S) of the path.
    """

    path: FilterPath
    value: float

    @property
    def noise(self) -> NDArray[np.float64]:
        return self.path.noise

    @property
    def walk(self) -> NDArray[np.float64]:
        return self.path.walk


def fit_noise(plant: Plant, record: Record, walk: bool = False, rounds: int = 3, torque=None, start=None) -> NoiseFit:
    """Maximum-likelihood torque noise and reading variances of a plant on a record, all else held.

    walk: also the intensities of two wandering torques. A torque that the plant lacks then goes to them, and what is
    left as torque noise is what no slow torque explains. Raises ValueError if the filter loses the log.
    """
    theta = plant.theta
    scale = np.array([theta[0] - theta[2] ** 2 / theta[3], theta[3] - theta[2] ** 2 / theta[0]])
    T = float(np.median(np.diff(record.t)))
    base = record.variance * T * scale**2  # intensity at which a filter has the bandwidth of 1 rad/s
    path = None if start is None else follow(plant, record, start[0], start[1] if walk else None, torque=torque)
    for bandwidth in (_BANDWIDTH, 10.0 * _BANDWIDTH):
        if path is not None:
            break
        noise = np.concatenate([base * bandwidth**4, record.variance])
        path = follow(plant, record, noise, noise[:2] * _WANDER**2 if walk else None, torque=torque)
        if path is not None:
            break
    if path is None:
        raise ValueError(
            "the Kalman filter of this plant loses the log. The plant does not describe this rig: check signs, units "
            "and the pendulum's zero of the log, and that both are of the same device."
        )
    value = math.inf
    for _ in range(rounds):
        problem = _Problem(path, base, walk)
        new = follow(plant, record, *problem.unpack(_descend(problem)), torque=torque)
        if new is None:
            break
        before, value = value, _value(new.e, new.S)
        path = new
        if abs(before - value) < 0.5:
            break
    return NoiseFit(path, _value(path.e, path.S))


def _descend(problem: _Problem, iterations: int = 30, tolerance: float = 0.02) -> NDArray[np.float64]:
    """Levenberg–Marquardt whose steps are limited one by one: an intensity that goes to nothing is a flat direction
    of long steps, which must not hold up the others."""
    z = problem.start()
    damping, quiet = 1e-3, 0
    for _ in range(iterations):
        expansion = problem.expand(z)
        g, H = expansion.gradient, expansion.information
        free = ~((z <= problem.low) & (g > 0) | (z >= problem.high) & (g < 0))
        while damping < 1e6:
            A = H[np.ix_(free, free)]
            step = np.zeros_like(z)
            step[free] = np.linalg.solve(A + damping * np.diag(np.diag(A) + 1e-9), -g[free])
            trial = np.clip(z + np.clip(step, -2.0, 2.0), problem.low, problem.high)
            value = problem.value(trial)
            if value < expansion.value:
                break
            damping = max(10.0 * damping, 1e-3)
        else:
            return z
        z, damping = trial, max(damping / 10.0, 1e-6)
        quiet = quiet + 1 if expansion.value - value < tolerance else 0
        if quiet == 2:
            return z
    return z


class _Problem:
    """V of the intensities along a path, in the form that `minimise` takes.

    z: ln(intensity / base) of the two rows, ln of the factors on the readings' variances, then ln(walk / base).
    """

    def __init__(self, path: FilterPath, base: NDArray[np.float64], walk: bool) -> None:
        self.path = path if walk else path.without_torques()
        self.base, self.walk = base, walk
        # from a filter slower than 0.03 rad/s, which only counts, to one that follows each reading
        self.low = np.array([-14.0] * 2 + [-3.0] * 2 + [-14.0] * 2)[: 6 if walk else 4]
        self.high = np.array([35.0] * 2 + [4.0] * 2 + [45.0] * 2)[: 6 if walk else 4]

    def start(self) -> NDArray[np.float64]:
        p = self.path
        z = [np.log(p.noise[:2] / self.base), np.log(p.noise[2:] / p.record.variance)]
        if self.walk:
            z.append(np.log(p.walk / self.base))
        return np.clip(np.concatenate(z), self.low, self.high)

    def unpack(self, z: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
        noise = np.concatenate([self.base, self.path.record.variance]) * np.exp(z[:4])
        return noise, self.base * np.exp(z[4:]) if self.walk else None

    def run(self, z: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        p = self.path
        noise, walk = self.unpack(z)
        e, S = np.empty_like(p.e), np.empty_like(p.S)
        C = p.start_covariance.copy()
        n = C.shape[0]
        if walk is not None:
            C[n - 2, n - 2], C[n - 1, n - 1] = walk
        _refilter(
            p.record.t,
            p.predicted,
            p.filtered,
            p.transition,
            p.reading,
            p.e,
            p.plant.theta[:4],
            C,
            noise,
            np.zeros(0) if walk is None else walk,
            e,
            S,
            EV(),
        )
        return e, S

    def value(self, z: NDArray[np.float64]) -> float:
        value = _value(*self.run(z)) + self._prior(z)[0]
        return value if math.isfinite(value) else math.inf

    def _prior(self, z: NDArray[np.float64]) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
        weight = np.zeros(len(z))
        weight[2:4] = 1.0 / _FACTOR_PRIOR**2
        return 0.5 * float(weight @ z**2), weight * z, np.diag(weight)

    def expand(self, z: NDArray[np.float64]) -> Expansion:
        step = np.where(z + 1e-3 > self.high, -1e-3, 1e-3)
        trials = [z] + [z + step[i] * np.eye(len(z))[i] for i in range(len(z))]
        results = list(_THREADS.map(self.run, trials))
        e0, S0 = results[0]
        de = np.stack([(e - e0) / h for (e, _), h in zip(results[1:], step, strict=True)], axis=2)
        dS = np.stack([(S - S0) / h for (_, S), h in zip(results[1:], step, strict=True)], axis=2)
        prior = self._prior(z)
        g, information = _scores(e0, S0, de, dS, list(range(len(z))))
        return Expansion(_value(e0, S0) + prior[0], g.sum(axis=0) + prior[1], information + prior[2])


@compiled(nogil=True)
def _refilter(t, xp, xf, Phi, H, e_path, theta, C, noise, walk, e, S, every):
    """The Kalman filter of the kept linearisation under other intensities; fills e (N, 2) and S (N, 3)."""
    N, n = xp.shape
    d = np.zeros(n)  # this filter's estimate minus the path's
    moved, work, K, CH = np.zeros(n), np.empty((n, n)), np.empty((n, 2)), np.empty((n, 2))
    for k in range(N):
        if k > 0:
            T = t[k] - t[k - 1]
            for i in range(n):
                s = 0.0
                for m in range(n):
                    s += Phi[k - 1, i, m] * d[m]
                moved[i] = s
            d[:] = moved
            _propagate(C, Phi[k - 1], work)
            _add_torque_noise(C, xf[k - 1, 1], theta, noise, T)
            for i in range(walk.shape[0]):
                C[n - 2 + i, n - 2 + i] += walk[i] * T
        if k % every:
            e[k] = 0.0
            S[k, 0] = 1.0
            S[k, 1] = 0.0
            S[k, 2] = 1.0
            for i in range(n):
                d[i] += xp[k, i] - xf[k, i]
            continue
        _gain(C, H[k], noise[2], noise[3], K, S[k], CH)
        for a in range(2):
            s = e_path[k, a]
            for m in range(n):
                s -= H[k, a, m] * d[m]
            e[k, a] = s
        for i in range(n):
            # relative to the path's filtered state of this sample
            d[i] += xp[k, i] - xf[k, i] + K[i, 0] * e[k, 0] + K[i, 1] * e[k, 1]

def EV():
    from . import filter_path
    return filter_path.EVERY
