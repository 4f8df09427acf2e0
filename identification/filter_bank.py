"""A bank of extended Kalman filters over one log, compiled: innovations of many parameter vectors in one pass.

The stochastic grey box (Kristensen, Madsen & Jørgensen 2004): model (5) with white torque noise on each row, sampled
encoders as measurement. Filter b has its own parameters P[:, b] and runs on the same log. Derivatives of innovations
and covariances with respect to anything are differences between filters of the bank: no derivative of the model is
ever written down, so every effect of the library can be estimated as it is.

Covariances belong to *groups* of filters: a filter may share the gains of its group's leader (the leader alone then
carries the state Jacobian), which is the usual Gauss–Newton simplification of a frozen gain and three to four times
cheaper; a filter that leads its own group is exact.
"""

import numpy as np

from furuta_gym.plant.compiled import compiled
from furuta_gym.plant.dynamics import advance, mass_matrix
from furuta_gym.plant.effects.dispatch import read_sensors

_STEP = 1e-6  # of a state, for its Jacobian: far below 1/r and far above rounding


@compiled(nogil=True)
def _add_torque_noise(C, q2, theta, noise, T):
    """C (n, n) += covariance that white torques of intensity noise[:2] leave in the state after T seconds."""
    m11, m12, m22 = mass_matrix(q2, theta[0], theta[1], theta[2], theta[3])
    det = m11 * m22 - m12 * m12
    a, b, d = m22 / det, -m12 / det, m11 / det
    v11 = noise[0] * a * a + noise[1] * b * b
    v12 = noise[0] * a * b + noise[1] * b * d
    v22 = noise[0] * b * b + noise[1] * d * d
    for i in range(2):
        for j in range(2):
            v = v11 if i + j == 0 else (v22 if i + j == 2 else v12)
            C[i, j] += v * T * T * T / 3.0
            C[i + 2, j] += v * T * T / 2.0
            C[i, j + 2] += v * T * T / 2.0
            C[i + 2, j + 2] += v * T


@compiled(nogil=True)
def _propagate(C, Phi, work):
    """C ← Φ C Φᵀ."""
    n = C.shape[0]
    for i in range(n):
        for j in range(n):
            s = 0.0
            for m in range(n):
                s += Phi[i, m] * C[m, j]
            work[i, j] = s
    for i in range(n):
        for j in range(n):
            s = 0.0
            for m in range(n):
                s += work[i, m] * Phi[j, m]
            C[i, j] = s


@compiled(nogil=True)
def _gain(C, H, R1, R2, K, S, CH):
    """Innovation covariance S = (S11, S12, S22), gain K (n, 2), and C ← C − K S Kᵀ."""
    n = C.shape[0]
    for i in range(n):
        for a in range(2):
            s = 0.0
            for m in range(n):
                s += C[i, m] * H[a, m]
            CH[i, a] = s
    s11, s12, s22 = R1, 0.0, R2
    for m in range(n):
        s11 += H[0, m] * CH[m, 0]
        s12 += H[0, m] * CH[m, 1]
        s22 += H[1, m] * CH[m, 1]
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
def innovations(t, y, u, P, codes, x0, C0, noise, group, h_max, e, S, X_out):
    """Run B filters over a log of N samples; fills e (N, 2, B) and S (N, 3, G).

    t (N,) [s]; y (N, 2) readings [rad]; u (N, 1) commands held from t on; P (parameters, B); x0 (n, B) and C0 (n, n)
    mean and covariance of the first state; noise (4, B): torque intensities on the rows [{u}² s] and variances of the
    readings [rad²]; group (B,): the first G filters lead the groups, in order. X_out (N, n) receives the filtered
    state of filter 0 if it has N rows. Returns False if a filter diverged (e and S are then meaningless).
    """
    N, B = y.shape[0], P.shape[1]
    n, G = x0.shape[0], S.shape[2]
    lanes = G * (n + 1) + (B - G)
    lane = np.empty(B, dtype=np.int64)
    for b in range(B):
        lane[b] = b * (n + 1) if b < G else G * (n + 1) + b - G
    PL = np.empty((P.shape[0], lanes))
    X, Y, W = np.empty((n, lanes)), np.empty((2, lanes)), np.zeros((2, lanes))
    for b in range(B):
        for i in range(n + 1 if b < G else 1):
            PL[:, lane[b] + i] = P[:, b]
    x = x0.copy()
    C = np.empty((G, n, n))
    for g in range(G):
        C[g] = C0
    Phi, work, H = np.empty((n, n)), np.empty((n, n)), np.empty((2, n))
    K, CH = np.empty((G, n, 2)), np.empty((n, 2))
    for k in range(N):
        for sweep in range(2):  # first carry the state to sample k, then read it there
            if sweep == 0 and k == 0:
                continue
            for b in range(B):
                X[:, lane[b]] = x[:, b]
                if b < G:
                    for i in range(n):
                        X[:, lane[b] + 1 + i] = x[:, b]
                        X[i, lane[b] + 1 + i] += _STEP
            if sweep == 0:
                T = t[k] - t[k - 1]
                advance(X, t[k - 1], t[k], t, u, k - 1, W, PL, codes, h_max)
                for g in range(G):
                    for i in range(n):
                        for m in range(n):
                            Phi[i, m] = (X[i, lane[g] + 1 + m] - X[i, lane[g]]) / _STEP
                    _propagate(C[g], Phi, work)
                    _add_torque_noise(C[g], x[1, g], P[:4, g], noise[:, g], T)
                for b in range(B):
                    x[:, b] = X[:, lane[b]]
        Y[0] = X[0]
        Y[1] = X[1]
        read_sensors(X, PL, codes, Y)
        for g in range(G):
            for i in range(n):
                H[0, i] = (Y[0, lane[g] + 1 + i] - Y[0, lane[g]]) / _STEP
                H[1, i] = (Y[1, lane[g] + 1 + i] - Y[1, lane[g]]) / _STEP
            _gain(C[g], H, noise[2, g], noise[3, g], K[g], S[k, :, g], CH)
            if not (S[k, 0, g] > 0.0 and S[k, 0, g] * S[k, 2, g] > S[k, 1, g] ** 2 and np.abs(x[:, g]).max() < 1e6):
                return False
        for b in range(B):
            e1, e2 = y[k, 0] - Y[0, lane[b]], y[k, 1] - Y[1, lane[b]]
            e[k, 0, b] = e1
            e[k, 1, b] = e2
            g = group[b]
            for i in range(n):
                x[i, b] += K[g, i, 0] * e1 + K[g, i, 1] * e2
        if X_out.shape[0] == N:
            X_out[k] = x[:, 0]
    return True
