"""The compiled loops behind `noise`: one linearised log, filtered under several noise intensities side by side."""

import math

import numpy as np

from furuta_gym.plant.compiled import compiled
from furuta_gym.plant.dynamics import mass_matrix

from .arguments import Assumed, Linearised


@compiled(nogil=True)
def run_bank(t, used, theta, kept: Linearised, assumed: Assumed, e, S):
    """`path_kernels.run_filter` for L filters that share the linearisation and differ in what they assume.

    assumed: Assumed with first (n, n, L), noise (4, L) and walk (0 or 2, L). Fills e (N, 2, L) and S (N, 3, L).
    """
    about, carried, misread, Phi, H = kept.about, kept.carried, kept.misread, kept.transition, kept.reading
    noise, walk = assumed.noise, assumed.walk
    N, n = about.shape
    L = noise.shape[1]
    C, d = assumed.first.copy(), np.zeros((n, L))
    work, CH, K = np.empty((n, n, L)), np.empty((n, 2, L)), np.empty((n, 2, L))
    for k in range(N):
        if k > 0:
            T = t[k] - t[k - 1]
            _propagate_bank(C, d, Phi[k - 1], work, CH)
            _add_noise_bank(C, about[k - 1, 1], theta, noise, walk, T)
        if used[k, 0] or used[k, 1]:
            _update_bank(C, H[k], misread[k], noise, used[k], d, CH, K, e[k], S[k])
        else:
            for i in range(L):
                e[k, 0, i], e[k, 1, i] = 0.0, 0.0
                S[k, 0, i], S[k, 1, i], S[k, 2, i] = 1.0, 0.0, 1.0
        for a in range(n):
            shift = carried[k, a] - about[k, a]
            for i in range(L):
                d[a, i] += shift


@compiled(nogil=True)
def _propagate_bank(C, d, Phi, work, new):
    """C ← Φ C Φᵀ and d ← Φ d in every lane; rows of all lanes are long enough for whole registers."""
    n, L = d.shape
    rows, long = C.reshape(n, n * L), work.reshape(n, n * L)
    for a in range(n):
        for x in range(n * L):
            long[a, x] = 0.0
        for i in range(L):
            new[a, 0, i] = 0.0
        for m in range(n):
            f = Phi[a, m]
            if f != 0.0:
                for x in range(n * L):
                    long[a, x] += f * rows[m, x]
                for i in range(L):
                    new[a, 0, i] += f * d[m, i]
    for a in range(n):
        for i in range(L):
            d[a, i] = new[a, 0, i]
        for b in range(a):  # the product is not symmetric yet
            for i in range(L):
                kept = work[a, b, i]
                work[a, b, i] = work[b, a, i]
                work[b, a, i] = kept
    for a in range(n):
        for x in range(n * L):
            rows[a, x] = 0.0
        for m in range(n):
            f = Phi[a, m]
            if f != 0.0:
                for x in range(n * L):
                    rows[a, x] += f * long[m, x]


@compiled(nogil=True)
def _add_noise_bank(C, q2, theta, noise, walk, T):
    """As `one_filter.add_torque_noise`, in every lane, and what the walking torques add."""
    n, L = C.shape[0], noise.shape[1]
    m11, m12, m22 = mass_matrix(q2, theta[0], theta[1], theta[2], theta[3])
    det = m11 * m22 - m12 * m12
    a, b, d = m22 / det, -m12 / det, m11 / det
    t2, t3 = T * T / 2.0, T * T * T / 3.0
    for r in range(2):
        for c in range(2):
            f0 = (a if r == 0 else b) * (a if c == 0 else b)
            f1 = (b if r == 0 else d) * (b if c == 0 else d)
            for i in range(L):
                v = f0 * noise[0, i] + f1 * noise[1, i]
                C[r, c, i] += v * t3
                C[r + 2, c, i] += v * t2
                C[r, c + 2, i] += v * t2
                C[r + 2, c + 2, i] += v * T
    for w in range(walk.shape[0]):
        for i in range(L):
            C[n - 2 + w, n - 2 + w, i] += walk[w, i] * T


@compiled(nogil=True)
def _update_bank(C, H, misread, noise, used, d, CH, K, e, S):
    """A reading in every lane: C ← C − C Hᵀ S⁻¹ H C, d ← d + C Hᵀ S⁻¹ e; an angle that is not used has e = 0, S = 1."""
    n, L = d.shape
    for r in range(2):
        for i in range(L):
            e[r, i] = misread[r] if used[r] else 0.0
            S[2 * r, i] = noise[2 + r, i] if used[r] else 1.0
        for a in range(n):
            for i in range(L):
                CH[a, r, i] = 0.0
        for m in range(n):
            h = H[r, m]
            if h != 0.0 and used[r]:
                for i in range(L):
                    e[r, i] -= h * d[m, i]
                for a in range(n):
                    for i in range(L):
                        CH[a, r, i] += h * C[a, m, i]
    for i in range(L):
        S[1, i] = 0.0
    for m in range(n):
        h0, h1 = H[0, m] if used[0] else 0.0, H[1, m] if used[1] else 0.0
        for i in range(L):
            S[0, i] += h0 * CH[m, 0, i]
            S[1, i] += h0 * CH[m, 1, i]
            S[2, i] += h1 * CH[m, 1, i]
    for a in range(n):
        for i in range(L):
            det = S[0, i] * S[2, i] - S[1, i] * S[1, i]
            K[a, 0, i] = (CH[a, 0, i] * S[2, i] - CH[a, 1, i] * S[1, i]) / det
            K[a, 1, i] = (CH[a, 1, i] * S[0, i] - CH[a, 0, i] * S[1, i]) / det
            d[a, i] += K[a, 0, i] * e[0, i] + K[a, 1, i] * e[1, i]
        for b in range(a + 1):
            for i in range(L):
                C[a, b, i] -= K[a, 0, i] * CH[b, 0, i] + K[a, 1, i] * CH[b, 1, i]
                C[b, a, i] = C[a, b, i]


@compiled(nogil=True)
def differentiate_noise(e, S, step, gradient, information):
    """V of the first of the filters e (N, 2, n + 1), S (N, 3, n + 1); filter i + 1 is shifted by step[i].

    With D = dS and S = L Lᵀ: information ½ tr(S⁻¹ D S⁻¹ D) + deᵀ S⁻¹ de, summed over samples.
    """
    N, n = e.shape[0], step.shape[0]
    rows = np.empty((5, n))
    V = 0.0
    for k in range(N):
        l11 = math.sqrt(S[k, 0, 0])
        l21 = S[k, 1, 0] / l11
        l22 = math.sqrt(S[k, 2, 0] - l21 * l21)
        w1 = e[k, 0, 0] / l11
        w2 = (e[k, 1, 0] - l21 * w1) / l22
        V += 0.5 * (w1 * w1 + w2 * w2) + math.log(l11 * l22)
        for i in range(n):
            d1 = (e[k, 0, i + 1] - e[k, 0, 0]) / (step[i] * l11)
            d2 = ((e[k, 1, i + 1] - e[k, 1, 0]) / step[i] - l21 * d1) / l22
            a11 = (S[k, 0, i + 1] - S[k, 0, 0]) / (step[i] * l11 * l11)
            b = ((S[k, 1, i + 1] - S[k, 1, 0]) / step[i] - l21 * l11 * a11) / l22
            a12 = b / l11
            a22 = ((S[k, 2, i + 1] - S[k, 2, 0]) / step[i] - 2.0 * l21 * b - l21 * l21 * a11) / (l22 * l22)
            rows[0, i], rows[1, i] = d1, d2
            rows[2, i], rows[3, i], rows[4, i] = a11 * math.sqrt(0.5), a12, a22 * math.sqrt(0.5)
            gradient[i] += w1 * d1 + w2 * d2
            gradient[i] += 0.5 * (a11 + a22 - w1 * w1 * a11 - 2.0 * w1 * w2 * a12 - w2 * w2 * a22)
        for i in range(n):
            for j in range(n):
                for r in range(5):
                    information[i, j] += rows[r, i] * rows[r, j]
    return V
