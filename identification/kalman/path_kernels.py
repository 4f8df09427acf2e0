"""The compiled loops behind `path`; its `FilterPath` and `arguments` say what the arrays are."""

import numpy as np

from furuta_gym.plant.advance import workspace
from furuta_gym.plant.compiled import compiled
from furuta_gym.plant.effects.dispatch import read_sensors
from furuta_gym.plant.integration_step import (
    fitted_step,
    friction_rate,
    moving_step,
    response_rate,
    rest_slopes,
)
from furuta_gym.plant.sign_changes import advance_alike

from .arguments import Assumed, Filtered, Linearised, Model, Readings
from .bank import STATE_STEP, whole_registers
from .one_filter import add_torque_noise, propagate
from .sharpness import effective_sharpness, sharpest


@compiled(nogil=True)
def follow_log(
    readings: Readings,
    used,
    model: Model,
    assumed: Assumed,
    spread,
    kept: Linearised,
    found: Filtered,
):
    """Linearises a log and filters it: fills `kept` (Linearised) and `found` (Filtered).

    model: Model of one plant. assumed: Assumed. With spread (N, 2) [rad²/s²], the variances of their velocities, the
    states `kept.about` are given, else they are the filter's own. Returns False if the filter loses the log.
    """
    t, y, u = readings.t, readings.y, readings.u
    P, codes, sharp = model.P, model.codes, model.sharp
    first, noise, walk = assumed.first, assumed.noise, assumed.walk
    about, carried, misread = kept.about, kept.carried, kept.misread
    Phi, push, H = kept.transition, kept.push, kept.reading
    filtered, Cf, gains, e, S = found.filtered, found.covariance, found.gain, found.e, found.S
    N, n = y.shape[0], first.shape[0]
    rows = n - walk.shape[0]
    given = spread.shape[0] == N
    lanes = whole_registers(rows + 3)
    X, Y, W = np.empty((rows, lanes)), np.empty((2, lanes)), np.zeros((2, lanes))
    PL = np.empty((P.shape[0], lanes))
    for i in range(lanes):
        PL[:, i] = P[:, 0]
    work, CH, before = np.empty((n, n)), np.empty((n, 2)), np.empty((rows, lanes))
    space, state, source = workspace(rows, lanes)
    full1, full2 = sharpest(P[:, 0], sharp)
    slopes, response = rest_slopes(P[:, 0].copy(), codes, rows), response_rate(P[:, 0].copy(), codes, rows)
    moving = moving_step(P[:, 0].copy(), codes, rows, full1, full2, response, 1.0)
    C, d = first.copy(), np.zeros(n)
    small = 1e-3 * P[3, 0]  # of a torque, for its Jacobian: the motion is nearly linear in it
    plain = codes.shape[0] == 0 and small == 0.0
    for k in range(N):
        if k > 0:
            T = t[k] - t[k - 1]
            for m in range(sharp.shape[0]):
                row, v = sharp[m, 0], sharp[m, 1]
                known = spread[k - 1, v - 2] if given else C[v, v]
                for i in range(lanes):
                    PL[row, i] = effective_sharpness(P[row, 0], known)
            for i in range(lanes):
                X[:, i] = about[k - 1, :rows]
                for a in range(2):
                    W[a, i] = about[k - 1, rows + a] if n > rows else 0.0
            for i in range(rows):
                X[i, 1 + i] += STATE_STEP
            W[0, rows + 1] += small
            W[1, rows + 2] += small
            r1, r2 = sharpest(PL[:, 0], sharp)
            step = fitted_step(friction_rate(slopes, r1 / full1, r2 / full2), response, 1.0)
            advance_alike(
                X, t[k - 1], t[k], t, u, k - 1, W, PL, codes, step, moving, r1, r2, plain, before, space, state, source
            )  # fmt: skip
            for i in range(rows):
                for m in range(rows):
                    Phi[k - 1, i, m] = (X[i, 1 + m] - X[i, 0]) / STATE_STEP
                for a in range(2):
                    push[k - 1, i, a] = (X[i, rows + 1 + a] - X[i, 0]) / small
                carried[k, i] = X[i, 0]
            for i in range(rows, n):
                Phi[k - 1, i, i] = 1.0
                Phi[k - 1, :rows, i] = push[k - 1, :rows, i - rows]
                carried[k, i] = about[k - 1, i]
            propagate(C, Phi[k - 1], work)
            add_torque_noise(C, about[k - 1, 1], P[:4, 0], noise, T)
            for a in range(walk.shape[0]):
                C[rows + a, rows + a] += walk[a] * T
            _times(Phi[k - 1], d, work[0])  # d: the filter's estimate less the point of linearisation
            d[:] = work[0]
        for i in range(lanes):
            X[:, i] = carried[k, :rows]
        for i in range(rows):
            X[i, 1 + i] += STATE_STEP
        Y[0] = X[0]
        Y[1] = X[1]
        read_sensors(X, PL, codes, Y)
        for a in range(2):
            misread[k, a] = y[k, a] - Y[a, 0]
            for i in range(rows):
                H[k, a, i] = (Y[a, 1 + i] - Y[a, 0]) / STATE_STEP
        _update(C, H[k], misread[k], noise, used[k], d, gains[k], e[k], S[k], CH)
        Cf[k] = C
        for i in range(n):
            filtered[k, i] = carried[k, i] + d[i]
        if not given:
            about[k] = filtered[k]
        for i in range(n):
            d[i] = filtered[k, i] - about[k, i]
        if not (S[k, 0] > 0.0 and S[k, 0] * S[k, 2] > S[k, 1] ** 2 and np.abs(filtered[k]).max() < 1e6):
            return False
    return True


@compiled(nogil=True)
def gain(C, H, R1, R2, used, K, S, CH):
    """Innovation covariance S = (S11, S12, S22), gain K (n, 2), and C ← C − K S Kᵀ; CH (n, 2) is work space.

    used (2,): readings that are taken. Another one has a gain of 0, and stands in S as 1."""
    n = C.shape[0]
    for i in range(n):
        for a in range(2):
            s = 0.0
            for m in range(n):
                s += C[i, m] * H[a, m]
            CH[i, a] = s if used[a] else 0.0
    s11, s12, s22 = R1 if used[0] else 1.0, 0.0, R2 if used[1] else 1.0
    for m in range(n):
        s11 += H[0, m] * CH[m, 0]
        s12 += H[0, m] * CH[m, 1]
        s22 += H[1, m] * CH[m, 1]
    if not (used[0] and used[1]):
        s12 = 0.0
    det = s11 * s22 - s12 * s12
    for i in range(n):
        K[i, 0] = (CH[i, 0] * s22 - CH[i, 1] * s12) / det
        K[i, 1] = (CH[i, 1] * s11 - CH[i, 0] * s12) / det
    for i in range(n):
        for j in range(i + 1):
            C[i, j] -= K[i, 0] * CH[j, 0] + K[i, 1] * CH[j, 1]
            C[j, i] = C[i, j]
    S[0], S[1], S[2] = s11, s12, s22


@compiled(nogil=True)
def _times(A, x, out):
    for i in range(A.shape[0]):
        s = 0.0
        for m in range(A.shape[1]):
            s += A[i, m] * x[m]
        out[i] = s


@compiled(nogil=True)
def _update(C, H, misread, noise, used, d, K, e, S, CH):
    """A reading of both angles: C, d (estimate less `carried`), K, e, S in place; nothing where neither is used."""
    n = C.shape[0]
    if not (used[0] or used[1]):
        K[:] = 0.0
        e[:] = 0.0
        S[0], S[1], S[2] = 1.0, 0.0, 1.0
        return
    gain(C, H, noise[2], noise[3], used, K, S, CH)
    for a in range(2):
        s = misread[a]
        for m in range(n):
            s -= H[a, m] * d[m]
        e[a] = s if used[a] else 0.0
    for i in range(n):
        d[i] += K[i, 0] * e[0] + K[i, 1] * e[1]


@compiled(nogil=True)
def run_filter(t, used, theta, kept: Linearised, assumed: Assumed, found: Filtered):
    """The linear filter on a Linearised log; fills `found` (Filtered), means, covariances and gains only where
    `found.filtered` has N rows. theta: θ1 … θ4 (4,)."""
    about, carried, misread, Phi, H = kept.about, kept.carried, kept.misread, kept.transition, kept.reading
    first, noise, walk = assumed.first, assumed.noise, assumed.walk
    filtered, Cf, gains, e, S = found.filtered, found.covariance, found.gain, found.e, found.S
    N, n = about.shape
    keep = filtered.shape[0] == N
    C, d = first.copy(), np.zeros(n)
    work, K, CH = np.empty((n, n)), np.empty((n, 2)), np.empty((n, 2))
    for k in range(N):
        if k > 0:
            T = t[k] - t[k - 1]
            propagate(C, Phi[k - 1], work)
            add_torque_noise(C, about[k - 1, 1], theta, noise, T)
            for a in range(walk.shape[0]):
                C[n - 2 + a, n - 2 + a] += walk[a] * T
            _times(Phi[k - 1], d, work[0])
            d[:] = work[0]
        _update(C, H[k], misread[k], noise, used[k], d, K, e[k], S[k], CH)
        if keep:
            gains[k] = K
            Cf[k] = C
            for i in range(n):
                filtered[k, i] = carried[k, i] + d[i]
        for i in range(n):
            d[i] += carried[k, i] - about[k, i]


@compiled(nogil=True)
def run_smoother(kept: Linearised, found: Filtered, used, mean, variance):
    """Backward recursion of the adjoint λ and its covariance Λ: mean = x̂ − C λ, variance = diag(C − C Λ C)."""
    filtered, Cf, gains, e, S = found.filtered, found.covariance, found.gain, found.e, found.S
    Phi, H = kept.transition, kept.reading
    N, n = filtered.shape
    lam, L = np.zeros(n), np.zeros((n, n))
    back, M, work = np.zeros(n), np.zeros((n, n)), np.zeros((n, n))
    A, keep = np.zeros((2, 2)), np.zeros((n, n))
    for k in range(N - 1, -1, -1):
        for i in range(n):
            s, v = filtered[k, i], Cf[k, i, i]
            for m in range(n):
                s -= Cf[k, i, m] * lam[m]
                for r in range(n):
                    v -= Cf[k, i, m] * L[m, r] * Cf[k, r, i]
            mean[k, i] = s
            variance[k, i] = max(v, 0.0)
        if k == 0:
            return
        # through the reading: λ ← (I − K H)ᵀ λ − Hᵀ S⁻¹ e,  Λ ← (I − K H)ᵀ Λ (I − K H) + Hᵀ S⁻¹ H
        if used[k, 0] or used[k, 1]:
            det = S[k, 0] * S[k, 2] - S[k, 1] ** 2
            A[0, 0], A[1, 1] = S[k, 2] / det, S[k, 0] / det
            A[0, 1] = A[1, 0] = -S[k, 1] / det
            for i in range(n):
                for m in range(n):
                    keep[i, m] = (1.0 if i == m else 0.0) - gains[k, i, 0] * H[k, 0, m] - gains[k, i, 1] * H[k, 1, m]
            _sandwich(L, keep, work, M)
            for i in range(n):
                s = 0.0
                for r in range(n):
                    s += keep[r, i] * lam[r]
                for a in range(2):
                    if not used[k, a]:
                        continue
                    for b in range(2):
                        s -= H[k, a, i] * A[a, b] * e[k, b]
                        for m in range(n):
                            M[i, m] += H[k, a, i] * A[a, b] * H[k, b, m]
                back[i] = s
        else:
            back[:] = lam
            M[:] = L
        _sandwich(M, Phi[k - 1], work, L)  # through the motion: λ ← Φᵀ λ,  Λ ← Φᵀ Λ Φ
        for i in range(n):
            s = 0.0
            for r in range(n):
                s += Phi[k - 1, r, i] * back[r]
            lam[i] = s


@compiled(nogil=True)
def _sandwich(M, A, work, out):
    """out = Aᵀ M A."""
    n = M.shape[0]
    for i in range(n):
        for m in range(n):
            s = 0.0
            for r in range(n):
                s += M[i, r] * A[r, m]
            work[i, m] = s
    for i in range(n):
        for m in range(n):
            s = 0.0
            for r in range(n):
                s += A[r, i] * work[r, m]
            out[i, m] = s
