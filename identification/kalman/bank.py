"""A bank of extended Kalman filters over one log, compiled: innovations of many parameter vectors in one pass.

The stochastic grey box (Kristensen, Madsen & Jørgensen 2004): model (5) with white torque noise on each row, sampled
encoders as measurement. Filter b has its own parameters P[:, b] and runs on the same log. Derivatives of innovations
and covariances with respect to anything are differences between filters of the bank: no derivative of the model is
ever written down, so every effect of the library can be estimated as it is.

Filters of a bank come in three kinds, by what they carry of their own:
    exact     its own state Jacobian, covariance and gain (n + 1 lanes);
    leaders   covariance and gain of their own, the Jacobian of filter 0: right to first order for what changes the
              noise only;
    followers the gain of filter 0: the usual Gauss–Newton simplification of a frozen gain, three to four times cheaper.

tanh(r q̇) is sharper than what a filter knows of q̇ where noise is large, and its slope at the mean then says nothing.
So the mean over the velocity's uncertainty σ is taken: with tanh(r v) ≈ erf(√π r v / 2),

    E tanh(r (v + σ ξ)) ≈ tanh(ρ v),   ρ = r / √(1 + (π/2) r² σ²),

which is statistical linearisation (Gelb 1974, section 6.2) of the friction: ρ takes the place of r, sample by sample.
"""

import math

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant.compiled import compiled
from furuta_gym.plant.dynamics import advance, mass_matrix, shared_steps, substep
from furuta_gym.plant.effects.dispatch import read_sensors
from furuta_gym.plant.layout import ParameterLayout

_ROOT_HALF = math.sqrt(0.5)
_NORMAL = 1.0 / math.sqrt(2.0 * math.pi)
_REGISTER = 4  # lanes
_SPEED = {"r1": 2, "r2": 3}  # the state in which the velocity of its friction is
_LONGEST = 1e-3  # s, of the integration
STATE_STEP = 1e-6  # of a state, for its Jacobian: far below 1/r and far above rounding


@compiled(forceinline=True)
def whole_registers(lanes):
    """So many lanes, and as many more as fill up the last SIMD register: single ones take longer than four."""
    return (lanes + _REGISTER - 1) // _REGISTER * _REGISTER


@compiled(forceinline=True)
def effective_sharpness(r, variance):
    """ρ [s/rad]: the sharpness left of r where the velocity is known to this variance [rad²/s²]."""
    return r / math.sqrt(1.0 + 0.5 * math.pi * r * r * variance)


@compiled(nogil=True)
def add_torque_noise(C, q2, theta, noise, T):
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
def counted(d, v, step):
    """What a rounded reading tells: (e, S, cost) of a reading d beyond its prediction, whose variance is v.

    The angle behind the reading lies in a cell of width `step` around it (Curry 1970, "Gaussian fit"). cost is
    −log of the cell's probability over its width, less ½ log 2π. e and S are the innovation and its variance of the
    Gaussian reading that would leave the same mean and variance as the cell does; for step → 0 that is d and v.
    """
    if step * step < 0.04 * v:  # a cell narrow against the prediction: its width is a variance (Sheppard)
        S = v + step * step / 12.0
        return d, S, 0.5 * (d * d / S + math.log(S))
    s = math.sqrt(v)
    sign = 1.0 if d >= 0.0 else -1.0
    a, b = (abs(d) - 0.5 * step) / s, (abs(d) + 0.5 * step) / s
    if a < 4.0:
        at_a, at_b = _NORMAL * math.exp(-0.5 * a * a), _NORMAL * math.exp(-0.5 * b * b)
        inside = 0.5 * (math.erfc(a * _ROOT_HALF) - math.erfc(b * _ROOT_HALF))
        cost = math.log(_NORMAL * step / inside)
    else:  # far out in the tail: everything over φ(a)
        at_a, at_b = 1.0, math.exp(max(-0.5 * (b * b - a * a), -700.0))
        inside = _mills(a) - at_b * _mills(b)
        cost = 0.5 * a * a + math.log(step / inside)
    mean = (at_a - at_b) / inside
    kept = min(max(1.0 + (a * at_a - b * at_b) / inside - mean * mean, 0.0), 1.0 - 1e-9)  # of the variance
    S = v / (1.0 - kept)
    return sign * mean * S / s, S, cost


@compiled(forceinline=True)
def _mills(x):
    """(1 − Φ(x)) / φ(x) for x ≥ 4, by its continued fraction."""
    f = x
    for k in range(24, 0, -1):
        f = x + k / f
    return 1.0 / f


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


@compiled(nogil=True)
def innovations(readings, model, first, noise, zeros, exact, leaders, coarser, result):
    """Run B filters over a log of N samples; fills `result`.

    readings: Readings. model: Model of B plants. first: Gaussian, means (n, B). noise (4, B): torque intensities on
    the rows [{u}² s] and variances of the readings before rounding [rad²]. zeros (2, B) [rad]: what the encoders read
    where the angles are zero. Of the filters, the first `exact` ≥ 1
    carry Jacobians, the first `leaders` covariances, the others follow filter 0. coarser: factor on the integration
    step. result: BankResult. Returns False if a filter diverged (the results are then meaningless).
    """
    t, y, u, quantum = readings.t, readings.y, readings.u, readings.quantum
    P, codes, sharp = model.P, model.codes, model.sharp
    e, S, cost, direct, states = result.e, result.S, result.cost, result.direct, result.states
    N, B = y.shape[0], P.shape[1]
    n, G = first.mean.shape[0], leaders
    # lanes 0 … B−1 are the filters, then n shifted states of each exact one; the rest do as filter 0
    lanes = whole_registers(exact * n + B)
    plain = codes.shape[0] == 0
    X, Y, W = np.zeros((n, lanes)), np.empty((2, lanes)), np.zeros((2, lanes))
    PL = np.empty((P.shape[0], lanes))
    owner = np.empty(lanes, dtype=np.int64)
    for k in range(lanes):
        owner[k] = k if k < B else ((k - B) // n if k < B + exact * n else 0)
        PL[:, k] = P[:, owner[k]]
    x = first.mean.copy()
    C = np.empty((G, n, n))
    for g in range(G):
        C[g] = first.covariance
    Phi, H = np.empty((exact, n, n)), np.zeros((exact, 2, n))
    work, K, CH, d = np.empty((n, n)), np.empty((G, n, 2)), np.empty(n), np.empty(2)
    own_e, own_S, prior = np.empty((G, 2)), np.empty((G, 3)), np.empty((G, 2))
    for g in range(exact):
        H[g, 0, 0] = 1.0
        H[g, 1, 1] = 1.0
    for k in range(N):
        if k > 0:
            T = t[k] - t[k - 1]
            _spread(X, x, exact)
            sharpest = 1.0
            for m in range(sharp.shape[0]):
                row, velocity = sharp[m, 0], sharp[m, 1]
                for i in range(lanes):
                    g = owner[i] if owner[i] < G else 0
                    PL[row, i] = effective_sharpness(P[row, owner[i]], C[g, velocity, velocity])
                sharpest = max(sharpest, PL[row, 0])
            longest = coarser * substep(sharpest, _LONGEST)
            if plain:
                steps = max(1, math.ceil(T / longest - 1e-6))
                shared_steps(X, u[k - 1, 0], T / steps, steps, PL)
            else:
                advance(X, t[k - 1], t[k], t, u, k - 1, W, PL, codes, longest)
            for g in range(exact):
                for m in range(n):
                    lane = B + g * n + m
                    for i in range(n):
                        Phi[g, i, m] = (X[i, lane] - X[i, g]) / STATE_STEP
            for g in range(G):
                propagate(C[g], Phi[g if g < exact else 0], work)
                add_torque_noise(C[g], x[1, g], P[:4, g], noise[:, g], T)
            for i in range(n):
                for b in range(B):
                    x[i, b] = X[i, b]
        if not plain:
            _spread(X, x, exact)
            Y[0] = X[0]
            Y[1] = X[1]
            if read_sensors(X, PL, codes, Y):
                for g in range(exact):
                    for m in range(n):
                        lane = B + g * n + m
                        H[g, 0, m] = (Y[0, lane] - Y[0, g]) / STATE_STEP
                        H[g, 1, m] = (Y[1, lane] - Y[1, g]) / STATE_STEP
        for g in range(G):
            d[0] = y[k, 0] - (x[0, g] if plain else Y[0, g]) - zeros[0, g]
            d[1] = y[k, 1] - (x[1, g] if plain else Y[1, g]) - zeros[1, g]
            h = H[g if g < exact else 0]
            cost[k, g] = read_pair(C[g], h, noise[:, g], d, quantum, K[g], own_e[g], own_S[g], prior[g], CH)
            if not (own_S[g, 0] > 0.0 and own_S[g, 2] > 0.0 and abs(x[1, g]) < 1e6):
                return False
            # one pair of readings for all: what rounding adds to the variance is filter 0's
            S[k, 0, g] = prior[g, 0] + own_S[0, 0] - prior[0, 0]
            S[k, 1, g] = own_S[g, 1]
            S[k, 2, g] = prior[g, 1] + own_S[0, 2] - prior[0, 1]
            if g == 0:
                direct[k, 0], direct[k, 1] = d[0], d[1]
                direct[k, 2], direct[k, 3] = own_S[0, 0] - prior[0, 0], own_S[0, 2] - prior[0, 1]
        z1 = (x[0, 0] if plain else Y[0, 0]) + zeros[0, 0] + own_e[0, 0]
        z2 = (x[1, 0] if plain else Y[1, 0]) + zeros[1, 0] + own_e[0, 1]
        for b in range(B):
            e1 = z1 - (x[0, b] if plain else Y[0, b]) - zeros[0, b]
            e2 = z2 - (x[1, b] if plain else Y[1, b]) - zeros[1, b]
            e[k, 0, b], e[k, 1, b] = e1, e2
            g = 0
            if b < G:
                g, e1, e2 = b, own_e[b, 0], own_e[b, 1]
            told = own_S[g, 1] / own_S[g, 0]
            for i in range(n):
                x[i, b] += K[g, i, 0] * e1 + K[g, i, 1] * (e2 - told * e1)
        if states.shape[0] == N:
            states[k] = x[:, 0]
    return True


@compiled(nogil=True)
def _spread(X, x, exact):
    """Lanes X from the filters' states x (n, B): each filter, then n states shifted by a step of the exact ones.
    Lanes beyond those do as filter 0."""
    n, B = x.shape
    for i in range(n):
        for b in range(B):
            X[i, b] = x[i, b]
        for g in range(exact):
            for m in range(n):
                X[i, B + g * n + m] = x[i, g]
            X[i, B + g * n + i] += STATE_STEP
        for k in range(B + exact * n, X.shape[1]):
            X[i, k] = x[i, 0]


def sharpness_rows(layout: ParameterLayout) -> NDArray[np.int64]:
    """(m, 2): rows of P that hold a friction's sharpness, and the state that its velocity is."""
    names = ("r1", "r2", "friction_sharpness.r1", "friction_sharpness.r2")
    return np.array([(row, _SPEED[name[-2:]]) for name in names for row in layout.rows(name)], dtype=np.int64)
