"""Covariance and gain of one filter at a time, compiled; `leaders` has them for many side by side."""

from furuta_gym.plant.compiled import compiled

from .leaders import shaken
from .rounding import counted


@compiled(nogil=True)
def add_torque_noise(C, q2, theta, noise, T):
    """C (n, n) += covariance that white torques of intensity noise[:2] leave in the state after T seconds."""
    v11, v12, v22 = shaken(q2, theta[0], theta[1], theta[2], theta[3], noise[0], noise[1])
    for i in range(2):
        for j in range(2):
            v = v11 if i + j == 0 else (v22 if i + j == 2 else v12)
            C[i, j] += v * T * T * T / 3.0
            C[i + 2, j] += v * T * T / 2.0
            C[i, j + 2] += v * T * T / 2.0
            C[i + 2, j + 2] += v * T


@compiled(nogil=True)
def propagate(C, Phi, work):
    """C ← Φ C Φᵀ."""
    n = C.shape[0]
    for i in range(n):
        for j in range(n):
            s = 0.0
            for m in range(n):
                s += Phi[i, m] * C[m, j]
            work[i, j] = s
    for i in range(n):
        for j in range(i + 1):
            s = 0.0
            for m in range(n):
                s += work[i, m] * Phi[j, m]
            C[i, j] = s
            C[j, i] = s


@compiled(nogil=True)
def read_pair(C, H, noise, d, quantum, K, e, S, prior, CH):
    """A pair of readings d (2,) beyond their predictions: gains K (n, 2) of the two in turn; C ← what is left.

    e (2,), S (3,) = (S11, S12, S22): joint innovations and covariance of the equivalent Gaussian readings, prior (2,):
    variances of the readings before rounding. K[:, 1] answers the second innovation less what the first told of it.
    Returns the cost.
    """
    n = C.shape[0]
    cost, told = 0.0, 0.0
    S[1] = 0.0
    for a in range(2):
        v = noise[2 + a]
        for i in range(n):
            x = 0.0
            for m in range(n):
                x += C[i, m] * H[a, m]
            CH[i] = x
        for i in range(n):
            v += H[a, i] * CH[i]
        if a == 0:
            e[0], S[0], cost = counted(d[0], v, quantum[0])
            for i in range(n):
                S[1] += H[1, i] * CH[i]
            told = S[1] / S[0]
            prior[0] = v
            s = S[0]
        else:
            e[1], s, c = counted(d[1] - told * e[0], v, quantum[1])
            e[1] += told * e[0]
            cost += c
            prior[1] = v + told * S[1]
            S[2] = s + told * S[1]
        for i in range(n):
            K[i, a] = CH[i] / s
        for i in range(n):
            for j in range(i + 1):
                C[i, j] -= K[i, a] * CH[j]
                C[j, i] = C[i, j]
    return cost
