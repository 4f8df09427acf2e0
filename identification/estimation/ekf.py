"""On-line identification by one extended Kalman filter over joints and parameters together.

The state is [q1, q2, q̇1, q̇2, η1 … η9], with η = ln θ for θ1 … θ5 (inertias and weight stay positive) and θ over its
start scale for friction. Parameters wander slowly if asked to, so that the filter follows a plant that changes. One
reading is one step of fixed cost: this is the identifier to run beside a controller, and the paper's "further
research" next to recursive least squares. Unlike that one it needs no derivative of a reading and has no bias from
noise in regressors, but it linearises anew at each estimate and its covariance is only as good as its torque noise.
While the parameters are still wrong their error acts like torques, so that noise starts large and calms down.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import Plant
from furuta_gym.plant.advance import workspace
from furuta_gym.plant.compiled import compiled
from furuta_gym.plant.integration_step import fitted_step, friction_rate, moving_step, rest_slopes
from furuta_gym.plant.layout import N_BASE, R1, R2
from furuta_gym.plant.sign_changes import advance_alike

from ..kalman.arguments import Gaussian, Readings
from ..kalman.bank import STATE_STEP
from ..kalman.noise_model import RecordNoise
from ..kalman.one_filter import add_torque_noise, propagate, read_pair
from ..kalman.record import SHOWN, stretches
from ..kalman.sharpness import effective_sharpness
from ..logs.log import Log, as_logs
from .start import candidates

_LOG = 5  # θ1 … θ5 are carried as logarithms
_PARAMETER_STEP = 1e-5
_START_STD = np.array([0.7] * _LOG + [1.0] * 4)  # of η: a factor two, or the friction's own size
_UNREST, _SETTLING = 1000.0, 1.5  # the torque noise starts this much larger and calms down with this time constant [s]
_WARM_UP = 3.0  # s of the log, from where its command begins, of which a start is made where none is given


@dataclass(frozen=True)
class OnlineHistory:
    """θ̂ after each reading: t (n,) [s] (logs follow one another), theta and std (n, 9), the last covariance (9, 9),
    the computing time of one sample [s], and the friction's sharpness r or (r1, r2) [s/rad] that the filter took."""

    t: NDArray[np.float64]
    theta: NDArray[np.float64]
    std: NDArray[np.float64]
    covariance: NDArray[np.float64]
    cost_per_sample: float
    sharpness: float | tuple[float, float]

    @property
    def last(self) -> NDArray[np.float64]:
        return self.theta[-1]


def track(
    logs: Log | Sequence[Log],
    start: Plant | None = None,
    *,
    wander: float = 0.0,
) -> OnlineHistory:
    """Run the joint filter over the logs, one after the other, parameters carried on.

    start: where θ starts (default: smoothed regression on the first seconds of the first log with a command, from
    where that begins to change). wander: how far η may drift in a second, to follow a plant that changes. Torque noise
    is taken to be two percent of the command for 10 ms; the friction's sharpness r is the start plant's. Raises
    ValueError for bad arguments, or if the filter diverges.
    """
    logs = as_logs(logs)
    if not logs:
        raise ValueError("track needs at least one log, got none")
    if not (math.isfinite(wander) and wander >= 0):
        raise ValueError(f"wander must be a number that is not negative [1/√s], got {wander!r}")
    first = next((log for log in logs if np.ptp(log.u) > 0), logs[0])  # a free decay says nothing of the scale
    if start is None:
        early = _warm_up(first)
        start = candidates([early], Plant(np.array([1, 0.1, 0.1, 1, 1, 0, 0, 0, 0.0]), unit=first.input_unit))[0].plant
    theta = start.theta
    scale = np.maximum(np.abs(theta[_LOG:]), [0.2 * theta[0], 0.1 * theta[3], theta[0], 0.3 * theta[3]])
    eta = np.concatenate([np.log(np.maximum(theta[:_LOG], 1e-9)), theta[_LOG:] / scale])
    C = np.diag(np.concatenate([np.zeros(4), _START_STD**2]))
    torque = 0.01 * (0.02 * np.std(first.u) * np.array([1.0, theta[3] / theta[0]])) ** 2
    times, etas, variances, offset, spent = [], [], [], 0.0, 0.0
    for piece, record in ((stretch.piece, stretch.record) for stretch in stretches(logs)):
        # of readings that are not rounded a record has a share of the noise that the log shows
        before_rounding = np.where(record.quantum > 0, 0.05 * record.quantum**2 / 12.0, record.variance / SHOWN)
        noise = RecordNoise(torque, before_rounding).packed()
        state = Gaussian(np.concatenate([record.y[0], record.velocity, eta]), C)
        C[:4], C[:, :4] = 0.0, 0.0
        C[[0, 1], [0, 1]] = 100.0 * record.variance
        C[[2, 3], [2, 3]] = record.velocity_std**2
        history = _History(np.empty((len(record.t), 9)), np.empty((len(record.t), 9)))
        scaling = _Scaling(scale, np.array(start.sharpness))
        settings = noise, wander, 0.0 if not etas else math.inf
        two = Readings(record.t[:2], record.y[:2], record.u[:2], record.quantum)
        copied = Gaussian(state.mean.copy(), state.covariance.copy())
        _track(two, copied, scaling, *settings, _History(*(a[:2] for a in history)))  # compiles, and is not timed
        begun = time.perf_counter()
        if not _track(record.readings, state, scaling, *settings, history):
            raise ValueError(f"{piece.source}: the joint filter diverges; give a better start, or check the signs")
        spent += time.perf_counter() - begun
        eta = state.mean[4:].copy()
        times.append(record.t - record.t[0] + offset)
        offset = float(times[-1][-1]) + piece.sample_time
        etas.append(history.eta)
        variances.append(history.variance)
    eta_history = np.concatenate(etas)
    theta_history = np.column_stack([np.exp(eta_history[:, :_LOG]), eta_history[:, _LOG:] * scale])
    slope = np.column_stack([theta_history[:, :_LOG], np.broadcast_to(scale, (len(eta_history), 4))])
    covariance = C[4:, 4:] * np.outer(slope[-1], slope[-1])
    std = np.sqrt(np.maximum(np.concatenate(variances), 0.0)) * slope
    cost = spent / len(eta_history)
    return OnlineHistory(np.concatenate(times), theta_history, std, covariance, cost, start.friction_sharpness)


def _warm_up(log: Log) -> Log:
    """The seconds of a log of which a start is made: before its command begins to change nothing tells the scale."""
    begins = float(log.t[np.argmax(log.u[1:] != log.u[:-1])])
    begins = max(min(begins, float(log.t[-1]) - _WARM_UP), float(log.t[0]))
    return log.slice(begins, begins + _WARM_UP)


class _Scaling(NamedTuple):
    """What friction's η are times (4,), and the sharpness (2,) [s/rad]."""

    friction: NDArray[np.float64]
    sharpness: NDArray[np.float64]


class _History(NamedTuple):
    """η (N, 9) and its variances (N, 9) after each reading."""

    eta: NDArray[np.float64]
    variance: NDArray[np.float64]


@compiled(nogil=True)
def _track(readings, state, scaling, noise, wander, age, history):
    """The filter: moves `state` (Gaussian of 13) in place and fills `history`. noise (4,): torque intensities, and
    variances of the readings before rounding. age [s]: of the estimate at the first reading. False if it diverged."""
    t, y, u, quantum = readings.t, readings.y, readings.u, readings.quantum
    x, C, scale, r = state.mean, state.covariance, scaling.friction, scaling.sharpness
    n, lanes = 13, 14  # lane 0, then each state and parameter shifted
    P, X = np.empty((N_BASE, lanes)), np.empty((4, lanes))
    W, before, space = np.zeros((2, lanes)), np.empty((4, lanes)), workspace(4, lanes)
    Phi, work, H = np.eye(n), np.empty((n, n)), np.zeros((2, n))
    K, CH, d, e, S, prior = np.empty((n, 2)), np.empty(n), np.empty(2), np.empty(2), np.empty(3), np.empty(2)
    torques, no_effects = np.empty(4), np.empty((0, 3), dtype=np.int64)
    rows, plain = X.shape[0], no_effects.shape[0] == 0  # no literals: with these, all would be compiled once more
    H[0, 0] = 1.0
    H[1, 1] = 1.0
    for k in range(y.shape[0]):
        if k > 0:
            T = t[k] - t[k - 1]
            for lane in range(lanes):
                for i in range(4):
                    X[i, lane] = x[i] + (STATE_STEP if lane == 1 + i else 0.0)
                for i in range(9):
                    eta = x[4 + i] + (_PARAMETER_STEP if lane == 5 + i else 0.0)
                    P[i, lane] = math.exp(eta) if i < _LOG else eta * scale[i - _LOG]
                P[R1, lane] = effective_sharpness(r[0], C[2, 2])
                P[R2, lane] = effective_sharpness(r[1], C[3, 3])
            slopes = rest_slopes(P[:, 0].copy(), no_effects, rows)
            longest = fitted_step(friction_rate(slopes, 1.0, 1.0), 0.0, 1.0)
            moving = moving_step(P[:, 0].copy(), no_effects, rows, P[R1, 0], P[R2, 0], 0.0, 1.0)
            advance_alike(
                X, t[k - 1], t[k], t, u, k - 1, W, P, no_effects, longest, moving, P[R1, 0], P[R2, 0], plain, before,
                *space,
            )  # fmt: skip
            for i in range(4):
                for m in range(n):
                    Phi[i, m] = (X[i, 1 + m] - X[i, 0]) / (STATE_STEP if m < 4 else _PARAMETER_STEP)
            propagate(C, Phi, work)
            torques[:] = noise
            torques[:2] *= 1.0 + _UNREST * math.exp(-(age + t[k] - t[0]) / _SETTLING)
            add_torque_noise(C, x[1], P[:4, 0], torques, T)
            for i in range(9):
                C[4 + i, 4 + i] += wander * wander * T
            x[:4] = X[:, 0]
        d[0], d[1] = y[k, 0] - x[0], y[k, 1] - x[1]
        read_pair(C, H, noise, d, quantum, K, e, S, prior, CH)
        told = S[1] / S[0]
        part = 1.0  # of the step in η: never past a factor e, nor to a mass matrix that is not positive
        for i in range(9):
            step = K[4 + i, 0] * e[0] + K[4 + i, 1] * (e[1] - told * e[0])
            part = min(part, 1.0 / max(abs(step), 1e-9))
        for i in range(n):
            x[i] += (1.0 if i < 4 else part) * (K[i, 0] * e[0] + K[i, 1] * (e[1] - told * e[0]))
        excess = 2.0 * x[6] - x[4] - x[7] - math.log(0.98)  # of θ3² over 0.98 θ1 θ4
        if excess > 0.0:
            x[6] -= 0.5 * excess
        for i in range(4):
            x[9 + i] = max(x[9 + i], 0.0)  # friction
        if not (abs(x[1]) < 1e6 and S[0] > 0.0 and S[2] > 0.0):
            return False
        for i in range(9):
            history.eta[k, i] = x[4 + i]
            history.variance[k, i] = C[4 + i, 4 + i]
    return True
