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

Each filter takes friction as sharp as its knowledge of the velocity allows: see `sharpness`.
"""

import numpy as np

from furuta_gym.plant.advance import workspace
from furuta_gym.plant.compiled import compiled, lanes_of
from furuta_gym.plant.effects.dispatch import read_sensors
from furuta_gym.plant.integration_step import (
    fitted_step,
    friction_rate,
    moving_step,
    response_rate,
    rest_slopes,
)
from furuta_gym.plant.sign_changes import advance_alike

from .arguments import BankResult, Gaussian, LeaderReadings, Model, Readings
from .leaders import packed, step_leaders
from .sharpness import effective_sharpness, sharpest

_REGISTER = 8  # lanes, of the widest processors
STATE_STEP = 1e-5  # of a state, for its Jacobian: far below 1/r, and so far above rounding that V is smooth over 1e-6


@compiled(forceinline=True)
def whole_registers(lanes):
    """So many lanes, and as many more as fill up the last SIMD register: a single one takes nearly as long as eight."""
    return (lanes + _REGISTER - 1) // _REGISTER * _REGISTER


@compiled(apart=True)
def _blunted(left, r, variance, lanes):
    """`effective_sharpness` of all lanes."""
    for i in range(lanes):
        left[i] = effective_sharpness(r[i], variance[i])


@compiled(nogil=True)
def innovations(
    readings: Readings,
    model: Model,
    first: Gaussian,
    noise,
    zeros,
    exact,
    leaders,
    coarser,
    result: BankResult,
    told: LeaderReadings,
):
    """Run B filters over a log of N samples; fills `result`.

    readings: Readings. model: Model of B plants. first: Gaussian, means (n, B). noise (4, B): torque intensities on
    the rows [{u}² s] and variances of the readings before rounding [rad²]. zeros (2, B) [rad]: what the encoders read
    where the angles are zero. Of the filters, the first `exact` carry Jacobians (1, or as many as lead), the first
    `leaders` covariances, the others follow filter 0. coarser: factor on the integration step. result: BankResult.
    told: LeaderReadings for whole_registers(leaders) filters, work space. Returns False if a filter diverged (the
    results are then meaningless).
    """
    t, y, u, quantum = readings.t, readings.y, readings.u, readings.quantum
    P, codes, sharp = model.P, model.codes, model.sharp
    e, S, cost, direct, states = result.e, result.S, result.cost, result.direct, result.states
    N, B = y.shape[0], P.shape[1]
    n, G, L = first.mean.shape[0], leaders, told.cost.shape[0]
    # lanes 0 … B−1 are the filters, then for each of n states the exact ones with that state shifted; the rest do as
    # filter 0
    lanes = whole_registers(exact * n + B)
    plain = codes.shape[0] == 0
    X, Y, W = np.zeros((n, lanes)), np.zeros((2, lanes)), np.zeros((2, lanes))
    PL = np.empty((P.shape[0], lanes))
    owner = np.empty(lanes, dtype=np.int64)
    for k in range(lanes):
        owner[k] = k if k < B else ((k - B) % exact if k < B + exact * n else 0)
        PL[:, k] = P[:, owner[k]]
    blunt, variance = PL.copy(), np.empty(lanes)
    work, state, source = workspace(n, lanes)
    before = np.empty((n, lanes))
    full1, full2 = sharpest(P[:, 0], sharp)
    slopes, response = rest_slopes(P[:, 0].copy(), codes, n), response_rate(P[:, 0].copy(), codes, n)
    moving = moving_step(P[:, 0].copy(), codes, n, full1, full2, response, coarser)
    x = first.mean.copy()
    # lanes of leaders beyond the last do as filter 0
    C, theta, intensity, q2 = np.empty((n * (n + 1) // 2, L)), np.empty((4, L)), np.empty((4, L)), np.empty(L)
    Phi, H = np.zeros((n, n, L)), np.zeros((2, n, L))
    for g in range(L):
        lead = g if g < G else 0
        theta[:, g] = P[:4, lead]
        intensity[:, g] = noise[:, lead]
        q2[g] = x[1, lead]
        for i in range(n):
            Phi[i, i, g] = 1.0  # to the first readings
            for j in range(i + 1):
                C[packed(i, j), g] = first.covariance[i, j]
    H[0, 0] = 1.0
    H[1, 1] = 1.0
    covariances, d, T = np.empty((n, n, L)), np.empty((2, L)), 0.0
    K, own_e, own_S, prior = told.K, told.e, told.S, told.prior
    _spread(X, x, exact)
    sensed = not plain and read_sensors(X, PL, codes, Y)
    for k in range(N):
        if k > 0:
            T = t[k] - t[k - 1]
            _spread(X, x, exact)
            for m in range(sharp.shape[0]):
                row, velocity = sharp[m, 0], packed(sharp[m, 1], sharp[m, 1])
                for i in range(lanes):
                    variance[i] = C[velocity, 0]
                for i in range(1, G):
                    variance[i] = C[velocity, i]
                for i in range(B, B + exact * n):
                    variance[i] = C[velocity, owner[i]]
                _blunted(lanes_of(PL, row), lanes_of(blunt, row), lanes_of(variance, 0), lanes)
            r1, r2 = sharpest(PL[:, 0], sharp)
            step = fitted_step(friction_rate(slopes, r1 / full1, r2 / full2), response, coarser)
            advance_alike(
                X, t[k - 1], t[k], t, u, k - 1, W, PL, codes, step, moving, r1, r2, plain, before, work, state, source
            )  # fmt: skip
            for i in range(n):
                for m in range(n):
                    shifted = B + m * exact
                    for g in range(exact):
                        Phi[i, m, g] = (X[i, shifted + g] - X[i, g]) / STATE_STEP
                    for g in range(exact, L):
                        Phi[i, m, g] = Phi[i, m, 0]
            for g in range(L):
                q2[g] = x[1, g if g < G else 0]
            for i in range(n):
                for b in range(B):
                    x[i, b] = X[i, b]
        if sensed:
            _spread(X, x, exact)
            Y[0] = X[0]
            Y[1] = X[1]
            read_sensors(X, PL, codes, Y)
            for a in range(2):
                for m in range(n):
                    for g in range(L):
                        own = g if g < exact else 0
                        H[a, m, g] = (Y[a, B + m * exact + own] - Y[a, own]) / STATE_STEP
        else:
            for a in range(2):
                for b in range(B):
                    Y[a, b] = x[a, b]
        for a in range(2):
            for g in range(L):
                lead = g if g < G else 0
                d[a, g] = y[k, a] - Y[a, lead] - zeros[a, lead]
        step_leaders(C, Phi, q2, theta, T, H, not sensed, intensity, d, quantum, told, covariances)
        for g in range(G):
            if not (own_S[0, g] > 0.0 and own_S[2, g] > 0.0 and abs(x[1, g]) < 1e6):
                return False
        # one pair of readings for all: what rounding adds to the variance is filter 0's
        added = own_S[0, 0] - prior[0, 0], own_S[2, 0] - prior[1, 0]
        for g in range(G):
            cost[k, g] = told.cost[g]
            S[k, 0, g] = prior[0, g] + added[0]
            S[k, 1, g] = own_S[1, g]
            S[k, 2, g] = prior[1, g] + added[1]
        direct[k, 0], direct[k, 1], direct[k, 2], direct[k, 3] = d[0, 0], d[1, 0], added[0], added[1]
        for a in range(2):
            reading = Y[a, 0] + zeros[a, 0] + own_e[a, 0]
            for b in range(B):
                e[k, a, b] = reading - Y[a, b] - zeros[a, b]
        for g in range(G):
            told_of = own_S[1, g] / own_S[0, g]
            for i in range(n):
                x[i, g] += K[0, i, g] * own_e[0, g] + K[1, i, g] * (own_e[1, g] - told_of * own_e[0, g])
        told_of = own_S[1, 0] / own_S[0, 0]
        for i in range(n):
            for b in range(G, B):
                x[i, b] += K[0, i, 0] * e[k, 0, b] + K[1, i, 0] * (e[k, 1, b] - told_of * e[k, 0, b])
        if states.shape[0] == N:
            states[k] = x[:, 0]
    return True


@compiled(nogil=True)
def _spread(X, x, exact):
    """Lanes X from the filters' states x (n, B): each filter, then for each of n states the exact ones with that state
    shifted by a step. Lanes beyond those do as filter 0."""
    n, B = x.shape
    for i in range(n):
        for b in range(B):
            X[i, b] = x[i, b]
        for m in range(n):
            for g in range(exact):
                X[i, B + m * exact + g] = x[i, g]
        for g in range(exact):
            X[i, B + i * exact + g] += STATE_STEP
        for k in range(B + exact * n, X.shape[1]):
            X[i, k] = x[i, 0]
