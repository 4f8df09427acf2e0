"""One extended Kalman filter along a log with everything it linearised kept, and its fixed-interval smoother.

The state is the plant's, [q1, q2, q̇1, q̇2, memory...], followed by two unknown torques w1, w2 on the arm's and the
pendulum's row, which wander as random walks. With no wandering the filter is the plain one (w stays zero); with it,
the smoothed w(t) is the torque that the model lacks (the "forcing function" of Hooker 2009).

The kept linearisation makes everything that follows cheap: smoothing, other noise intensities (`noise_fit`), the
innovations' sensitivity to any torque or reading error (`diagnosis.evidence`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import Plant
from furuta_gym.plant.compiled import compiled
from furuta_gym.plant.dynamics import advance, substep
from furuta_gym.plant.effects.dispatch import read_sensors

from .filter_bank import _STEP, _add_torque_noise, _gain, _propagate
from .prediction_error import Record

EVERY = 1
LONGEST_STEP = 1e-3  # s, of the integration


@dataclass(frozen=True)
class FilterPath:
    """A filter's way along a log of N samples; n is the plant's states + 2.

    predicted, filtered (N, n): means before and after reading k; covariance (N, n, n): after it. transition
    (N, n, n): d predicted[k+1] / d filtered[k] (its last two columns are the effect of a torque held for the sample;
    the last matrix is zero). reading (N, 2, n): d y / d state. gain (N, n, 2). e (N, 2) innovations [rad] and
    S (N, 3) their covariances (S11, S12, S22). noise (4,): torque intensities [{u}² s], variances of readings [rad²].
    walk (2,): intensities of w1, w2 [{u}²/s].
    """

    record: Record
    plant: Plant
    predicted: NDArray[np.float64]
    filtered: NDArray[np.float64]
    covariance: NDArray[np.float64]
    transition: NDArray[np.float64]
    reading: NDArray[np.float64]
    gain: NDArray[np.float64]
    e: NDArray[np.float64]
    S: NDArray[np.float64]
    noise: NDArray[np.float64]
    walk: NDArray[np.float64]
    start_covariance: NDArray[np.float64]

    @property
    def states(self) -> int:
        """Number of the plant's own states (the two torques come after them)."""
        return self.predicted.shape[1] - 2

    def without_torques(self) -> FilterPath:
        """The same path with the rows of w1 and w2 left out (views), for a filter that has no such states."""
        n = self.states
        return FilterPath(
            self.record,
            self.plant,
            self.predicted[:, :n],
            self.filtered[:, :n],
            self.covariance[:, :n, :n],
            self.transition[:, :n, :n],
            self.reading[:, :, :n],
            self.gain[:, :n],
            self.e,
            self.S,
            self.noise,
            self.walk,
            self.start_covariance[:n, :n],
        )


@dataclass(frozen=True)
class Smoothed:
    """Fixed-interval smoothed states (N, n) and their variances (N, n)."""

    mean: NDArray[np.float64]
    variance: NDArray[np.float64]


def follow(
    plant: Plant,
    record: Record,
    noise: NDArray[np.float64],
    walk: NDArray[np.float64] | None = None,
    torque_std: NDArray[np.float64] | None = None,
    torque: NDArray[np.float64] | None = None,
    longest_step: float = LONGEST_STEP,
) -> FilterPath | None:
    """Run the filter over a record; None if it diverged.

    noise (4,): torque intensities on the two rows [{u}² s] and variances of the two readings [rad²]. walk (2,):
    intensities of the unknown torques [{u}²/s], default none. torque_std (2,): how large they may be at the start
    [{u}], default the wandering of one second.
    """
    p, codes, rows = plant.packed()
    n, N = rows + 2, len(record.t)
    walk = np.zeros(2) if walk is None else np.asarray(walk, dtype=float)
    torque_std = np.sqrt(walk) if torque_std is None else np.asarray(torque_std, dtype=float)
    x0, C0 = first_state(record, p, codes, rows)
    start = np.zeros((n, n))
    start[:rows, :rows] = C0
    start[rows, rows], start[rows + 1, rows + 1] = torque_std**2
    arrays = [np.zeros((N, *shape)) for shape in ((n,), (n,), (n, n), (n, n), (2, n), (n, 2), (2,), (3,))]
    h_max = substep(min(1e4, max(1.0, p[9], p[10])), longest_step)
    ok = _follow(
        record.t, record.y, record.u, p[:, None], codes, np.zeros((N,2)) if torque is None else torque, x0, start.copy(), np.asarray(noise, float), walk, h_max, EVERY, *arrays
    )
    if not ok or not np.isfinite(arrays[6]).all():
        return None
    return FilterPath(record, plant, *arrays, np.asarray(noise, dtype=float), walk, start)


def first_state(
    record: Record, p: NDArray[np.float64], codes: NDArray[np.int64], rows: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean (rows,) and covariance (rows, rows) of the state at the first sample."""
    x0 = np.zeros((rows, 1))
    x0[:2, 0] = record.y[0]
    reading = x0[:2].copy()
    read_sensors(x0, p[:, None], codes, reading)
    x0[:2] -= reading - x0[:2]
    x0[2:4, 0] = record.velocity
    C0 = np.zeros((rows, rows))
    C0[[0, 1], [0, 1]] = record.variance
    C0[[2, 3], [2, 3]] = record.velocity_std**2
    return x0[:, 0], C0


def smooth(path: FilterPath) -> Smoothed:
    """Fixed-interval smoothing in the modified Bryson–Frazier form (no covariance is inverted, so that states that
    are known exactly, such as torques that do not wander, do no harm)."""
    mean, variance = np.empty_like(path.filtered), np.empty_like(path.filtered)
    _smooth(
        path.filtered, path.covariance, path.transition, path.reading, path.gain, path.e, path.S, mean, variance
    )
    return Smoothed(mean, variance)


@compiled(nogil=True)
def _follow(t, y, u, P, codes, torque, x, C, noise, walk, h_max, every, xp, xf, Cf, Phi, H, gains, e, S):
    N, n = y.shape[0], C.shape[0]
    rows = n - 2
    lanes = n + 1
    PL = np.empty((P.shape[0], lanes))
    for k in range(lanes):
        PL[:, k] = P[:, 0]
    X, Y, W = np.empty((rows, lanes)), np.empty((2, lanes)), np.zeros((2, lanes))
    work, CH = np.empty((n, n)), np.empty((n, 2))
    push = 1e-3 * P[3, 0]  # of a torque, for its Jacobian: the motion is nearly linear in it
    w = np.zeros(2)
    for k in range(N):
        for sweep in range(2):  # first carry the state to sample k, then read it there
            if sweep == 0 and k == 0:
                continue
            for i in range(lanes):
                X[:, i] = x
                W[:, i] = w
                if k > 0:
                    W[:, i] += torque[k - 1]
            for i in range(rows):
                X[i, 1 + i] += _STEP
            if sweep == 0:
                T = t[k] - t[k - 1]
                W[0, rows + 1] += push
                W[1, rows + 2] += push
                advance(X, t[k - 1], t[k], t, u, k - 1, W, PL, codes, h_max)
                for i in range(rows):
                    for m in range(n):
                        Phi[k - 1, i, m] = (X[i, 1 + m] - X[i, 0]) / (_STEP if m < rows else push)
                Phi[k - 1, rows, rows] = 1.0
                Phi[k - 1, rows + 1, rows + 1] = 1.0
                _propagate(C, Phi[k - 1], work)
                _add_torque_noise(C, x[1], P[:4, 0], noise, T)
                C[rows, rows] += walk[0] * T
                C[rows + 1, rows + 1] += walk[1] * T
                x[:] = X[:, 0]
        Y[0] = X[0]
        Y[1] = X[1]
        read_sensors(X, PL, codes, Y)
        for i in range(rows):
            H[k, 0, i] = (Y[0, 1 + i] - Y[0, 0]) / _STEP
            H[k, 1, i] = (Y[1, 1 + i] - Y[1, 0]) / _STEP
        xp[k, :rows] = x
        xp[k, rows:] = w
        if k % every:
            H[k] = 0.0
            gains[k] = 0.0
            S[k, 0] = 1.0
            S[k, 1] = 0.0
            S[k, 2] = 1.0
            xf[k] = xp[k]
            Cf[k] = C
            continue
        _gain(C, H[k], noise[2], noise[3], gains[k], S[k], CH)
        if not (S[k, 0] > 0.0 and S[k, 0] * S[k, 2] > S[k, 1] ** 2 and np.abs(x).max() < 1e6):
            return False
        e[k, 0], e[k, 1] = y[k, 0] - Y[0, 0], y[k, 1] - Y[1, 0]
        for i in range(n):
            xf[k, i] = xp[k, i] + gains[k, i, 0] * e[k, 0] + gains[k, i, 1] * e[k, 1]
        x[:] = xf[k, :rows]
        w[:] = xf[k, rows:]
        Cf[k] = C
    return True


@compiled(nogil=True)
def _smooth(xf, Cf, Phi, H, gains, e, S, mean, variance):
    N, n = xf.shape
    adjoint, L = np.zeros(n), np.zeros((n, n))
    carried, M, work = np.zeros(n), np.zeros((n, n)), np.zeros((n, n))
    A, KH = np.zeros((2, 2)), np.zeros((n, n))
    for k in range(N - 1, -1, -1):
        for i in range(n):
            s = xf[k, i]
            v = Cf[k, i, i]
            for m in range(n):
                s -= Cf[k, i, m] * adjoint[m]
                for r in range(n):
                    v -= Cf[k, i, m] * L[m, r] * Cf[k, r, i]
            mean[k, i] = s
            variance[k, i] = max(v, 0.0)
        if k == 0:
            return
        # back through the reading: λ ← (I − K H)ᵀ λ − Hᵀ S⁻¹ e,  Λ ← (I − K H)ᵀ Λ (I − K H) + Hᵀ S⁻¹ H
        det = S[k, 0] * S[k, 2] - S[k, 1] ** 2
        A[0, 0], A[1, 1] = S[k, 2] / det, S[k, 0] / det
        A[0, 1] = A[1, 0] = -S[k, 1] / det
        for i in range(n):
            for m in range(n):
                KH[i, m] = (1.0 if i == m else 0.0) - gains[k, i, 0] * H[k, 0, m] - gains[k, i, 1] * H[k, 1, m]
        for i in range(n):
            for m in range(n):
                s = 0.0
                for r in range(n):
                    s += L[i, r] * KH[r, m]
                work[i, m] = s
        for i in range(n):
            s = 0.0
            for r in range(n):
                s += KH[r, i] * adjoint[r]
            for a in range(2):
                for b in range(2):
                    s -= H[k, a, i] * A[a, b] * e[k, b]
            carried[i] = s
            for m in range(n):
                v = 0.0
                for r in range(n):
                    v += KH[r, i] * work[r, m]
                for a in range(2):
                    for b in range(2):
                        v += H[k, a, i] * A[a, b] * H[k, b, m]
                M[i, m] = v
        # back through the motion: λ ← Φᵀ λ,  Λ ← Φᵀ Λ Φ
        for i in range(n):
            s = 0.0
            for r in range(n):
                s += Phi[k - 1, r, i] * carried[r]
            adjoint[i] = s
            for m in range(n):
                v = 0.0
                for r in range(n):
                    v += M[i, r] * Phi[k - 1, r, m]
                work[i, m] = v
        for i in range(n):
            for m in range(n):
                v = 0.0
                for r in range(n):
                    v += Phi[k - 1, r, i] * work[r, m]
                L[i, m] = v
