"""Free runs from a filter's states over short windows of a log: how far a plant predicts, and how far it could.

All windows that are open at a time are lanes of one integration, so that each sees the log's own clock (an effect
that depends on time needs it) and the whole costs little more than one pass over the log.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant.advance import advance
from furuta_gym.plant.compiled import compiled
from furuta_gym.plant.effects.dispatch import read_sensors
from furuta_gym.plant.integration_step import SHORTEST_FITTED, substep

from ..kalman.arguments import Model
from ..kalman.noise_model import RecordNoise
from ..kalman.one_filter import add_torque_noise, propagate
from ..kalman.path import FilterPath
from ..kalman.path_kernels import gain
from ..kalman.sharpness import sharpness_rows

_LONGEST_STEP = 1e-3  # s: runs that start apart share no change of friction's sign
PER_HORIZON = 8
"""Windows that start within the shortest horizon."""


@dataclass(frozen=True)
class Windows:
    """Where free runs start and where they are compared: starts (M,) samples, targets (M, J) samples at horizons [s].

    Windows overlap; at most `open_at_once` are open at a time.
    """

    starts: NDArray[np.int64]
    targets: NDArray[np.int64]
    horizons: tuple[float, ...]

    @classmethod
    def over(
        cls, t: NDArray[np.float64], horizons: tuple[float, ...], settle: float, per_horizon: int = PER_HORIZON
    ) -> Windows:
        """Windows over a log with stamps t (N,) [s]; the first starts `settle` seconds in.

        `per_horizon` windows start within the shortest horizon. Raises ValueError if that is below two samples, or if
        the log is too short.
        """
        T = float(np.median(np.diff(t)))
        if min(horizons) < (1.0 - 1e-9) * 2 * T:
            longer = 2 * T * max(horizons) / min(horizons)
            raise ValueError(
                f"predictions over {max(horizons):g} s are compared from {1e3 * min(horizons):.3g} ms on, less than "
                f"two samples of {1e3 * T:.3g} ms. Choose a longer horizon: {np.ceil(1e3 * longer - 1e-6):g} ms or more"
            )
        if not cls.fit_into(t, horizons, settle, per_horizon):
            raise ValueError(
                f"the log lasts {t[-1] - t[0]:.3g} s at {1e3 * T:.3g} ms: too short for prediction over "
                f"{max(horizons):g} s after {settle:g} s of settling. Choose a shorter horizon or a longer log."
            )
        starts = _starts(t, horizons, settle, per_horizon)
        ends = [np.searchsorted(t, t[starts] + h - 0.5 * T) for h in horizons]
        return cls(starts, np.stack(ends, axis=1).astype(np.int64), tuple(horizons))

    @staticmethod
    def fit_into(
        t: NDArray[np.float64], horizons: tuple[float, ...], settle: float, per_horizon: int = PER_HORIZON
    ) -> bool:
        """Whether a log with stamps t (N,) [s] is long enough for `over`: twice `per_horizon` windows start in it."""
        return _starts(t, horizons, settle, per_horizon).size >= 2 * per_horizon

    @property
    def open_at_once(self) -> int:
        stride = int(np.min(np.diff(self.starts)))
        return int(np.max(self.targets[:, -1] - self.starts)) // stride + 1


def _starts(t: NDArray[np.float64], horizons: tuple[float, ...], settle: float, per_horizon: int) -> NDArray[np.int64]:
    """Samples at which windows start, from `settle` seconds in to the last that ends within the log."""
    T = float(np.median(np.diff(t)))
    first = int(np.searchsorted(t, t[0] + settle - 0.5 * T))  # the nearest sample, whatever a clock's jitter
    last = int(np.searchsorted(t, t[-1] - max(horizons) + 0.5 * T))
    return np.arange(first, last, max(1, round(min(horizons) / (per_horizon * T))), dtype=np.int64)


def free_run(path: FilterPath, windows: Windows) -> NDArray[np.float64]:
    """Errors (M, J, 2) [rad], reading minus prediction, of free runs from the path's filtered states.

    A run that leaves all bounds gives inf.
    """
    p, codes, rows = path.plant.packed()
    friction = min(1e4, max(path.plant.sharpest)), path.plant.friction_rate
    h_max = max(SHORTEST_FITTED, substep(*friction, _LONGEST_STEP))
    errors = np.full((*windows.targets.shape, 2), np.inf)
    states = np.ascontiguousarray(path.filtered[windows.starts, :rows])
    P = np.repeat(p[:, None], windows.open_at_once, axis=1)
    model = Model(P, codes, sharpness_rows(path.plant.layout))
    _free_run(path.record.readings, model, windows.starts, windows.targets, states, h_max, errors)
    return np.where(np.isfinite(errors), errors, np.inf)


def floor_covariance(path: FilterPath, windows: Windows, noise: RecordNoise) -> NDArray[np.float64]:
    """Covariance (M, J, 3) = (11, 12, 22) [rad²] of such errors if the plant were right and `noise` all there is.

    The sum of three parts: the error of the filtered state at the start carried over the horizon, the torque noise on
    the way, and the noise of the reading at its end.
    """
    n = path.states
    out = np.zeros((*windows.targets.shape, 3))
    motion = _Motion(
        t=path.record.t,
        used=path.used,
        q2=np.ascontiguousarray(path.about[:, 1]),
        transition=np.ascontiguousarray(path.transition[:, :n, :n]),
        reading=np.ascontiguousarray(path.reading[:, :, :n]),
        first=path.first[:n, :n].copy(),
        inertias=path.inertias,
    )
    _floor_covariance(motion, noise.packed(), windows.starts, windows.targets, windows.open_at_once, out)
    return out


class _Motion(NamedTuple):
    """Of a FilterPath what carries a covariance along: the plant's own states only, q2 (N,) where it is linearised."""

    t: NDArray[np.float64]
    used: NDArray[np.bool_]
    q2: NDArray[np.float64]
    transition: NDArray[np.float64]
    reading: NDArray[np.float64]
    first: NDArray[np.float64]
    inertias: NDArray[np.float64]


@compiled(nogil=True)
def _free_run(readings, model, starts, targets, states, h_max, errors):
    t, y, u, P, codes = readings.t, readings.y, readings.u, model.P, model.codes
    M, J = targets.shape
    rows, lanes = states.shape[1], P.shape[1]
    X, Y, W = np.zeros((rows, lanes)), np.zeros((2, lanes)), np.zeros((2, lanes))
    window = np.full(lanes, -1)  # the window that a lane carries
    following = np.zeros(lanes, dtype=np.int64)  # its next horizon
    new = 0
    for k in range(starts[0], targets[M - 1, J - 1] + 1):
        if k > starts[0]:
            advance(X, t[k - 1], t[k], t, u, k - 1, W, P, codes, h_max)
        Y[0] = X[0]
        Y[1] = X[1]
        read_sensors(X, P, codes, Y)
        for i in range(lanes):
            m = window[i]
            while m >= 0 and targets[m, following[i]] == k:
                errors[m, following[i], 0] = y[k, 0] - Y[0, i]
                errors[m, following[i], 1] = y[k, 1] - Y[1, i]
                following[i] += 1
                if following[i] == J:
                    window[i] = m = -1
            if m < 0 or not np.abs(X[:4, i]).max() < 1e4:
                X[:, i] = 0.0  # an idle lane rests, and a lost one has kept its inf
                window[i] = -1
        if new < M and starts[new] == k:
            lane = 0
            while window[lane] >= 0:
                lane += 1
            X[:, lane] = states[new]
            window[lane] = new
            following[lane] = 0
            new += 1


@compiled(nogil=True)
def _floor_covariance(motion, noise, starts, targets, lanes, out):
    t, used, q2, theta = motion.t, motion.used, motion.q2, motion.inertias
    Phi, H, C = motion.transition, motion.reading, motion.first.copy()
    M, J = targets.shape
    n = C.shape[0]
    work, CH, K, S = np.empty((n, n)), np.empty((n, 2)), np.empty((n, 2)), np.empty(3)
    CL = np.zeros((lanes, n, n))
    window = np.full(lanes, -1)
    following = np.zeros(lanes, dtype=np.int64)
    new = 0
    for k in range(targets[M - 1, J - 1] + 1):
        if k > 0:
            T = t[k] - t[k - 1]
            propagate(C, Phi[k - 1], work)
            add_torque_noise(C, q2[k - 1], theta, noise, T)
            for i in range(lanes):
                if window[i] >= 0:
                    propagate(CL[i], Phi[k - 1], work)
                    add_torque_noise(CL[i], q2[k - 1], theta, noise, T)
        if used[k, 0] or used[k, 1]:
            gain(C, H[k], noise[2], noise[3], used[k], K, S, CH)
        for i in range(lanes):
            m = window[i]
            while m >= 0 and targets[m, following[i]] == k:
                for a in range(2):
                    for b in range(a, 2):
                        s = noise[2 + a] if a == b else 0.0
                        for r in range(n):
                            for c in range(n):
                                s += H[k, a, r] * CL[i, r, c] * H[k, b, c]
                        out[m, following[i], a + b] = s
                following[i] += 1
                if following[i] == J:
                    window[i] = m = -1
        if new < M and starts[new] == k:
            lane = 0
            while window[lane] >= 0:
                lane += 1
            CL[lane] = C
            window[lane] = new
            following[lane] = 0
            new += 1
