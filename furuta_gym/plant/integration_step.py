"""How long a Runge–Kutta step may be: the one rule, of friction's sharpness and of how fast friction stops a motion."""

import math

import numpy as np

from .compiled import compiled
from .effects.dispatch import filter_command
from .integration import rates
from .layout import N_BASE

_STEP_TIMES_RATE = 1.0  # of friction
_AT_FIRST = 1.5  # the same, for a first look
LONGEST_FITTED = 2e-3
"""Longest step of a filter [s]. Against steps of 0.02 ms it changes a log-likelihood by 0.1 in 4000 samples."""
LONGEST_AT_FIRST = 2.5e-3
"""The same [s] for a first look. Runge–Kutta follows what settles in 1 ms, as the stiffest bristle, up to 2.78 ms."""
SHORTEST_FITTED = 5e-5
"""Shortest step [s] of a plant that is being fitted, as θ may go astray."""
_STEP_TIMES_RESPONSE = 1.0  # of a filter of the command
_SHORTEST_RESPONSE = 1e-4  # s, for such a filter
_MOMENT = 1e-6  # s: far below the time of any filter that matters
_SMALL = 1e-7  # rad/s: far below the speed 1/r at which any friction turns over
_CONSTANT = 4.0  # of r q̇: beyond it dry friction is constant to a thousandth


@compiled
def rest_slopes(p, codes, rows):
    """(a11, a12, a21, a22) [1/s]: how the accelerations fall with the speeds, −∂q̈/∂q̇, at rest upright, where the
    inertia is the least.

    p: parameters of a plant as packed, codes: its effects, rows: of its state. Where both directions differ, those of
    the steeper one."""
    return _slopes(p, codes, rows, 0.0, 0.0)


@compiled
def _slopes(p, codes, rows, v1, v2):
    """Slopes at these speeds [rad/s] in both directions, of which the steeper ones count."""
    lanes = 6
    P, X, K = np.empty((p.shape[0], lanes)), np.zeros((rows, lanes)), np.zeros((rows, lanes))
    for k in range(lanes):
        P[:, k] = p
        sign = 1.0 if k < 3 else -1.0
        X[2, k] = sign * (v1 + (_SMALL if k % 3 == 1 else 0.0))
        X[3, k] = sign * (v2 + (_SMALL if k % 3 == 2 else 0.0))
    t, W = np.zeros(lanes), np.zeros((2, lanes))
    rates(t, X, t, W, P, codes, np.empty((N_BASE, lanes)), np.empty((2, lanes)), K)
    for i in (1, 2, 4, 5):
        first, sign = 3 * (i // 3), 1.0 if i < 3 else -1.0
        for row in range(2, 4):
            K[row, i] = (K[row, first] - K[row, i]) / (sign * _SMALL)
    i = 1 if K[2, 1] + K[3, 2] >= K[2, 4] + K[3, 5] else 4
    return K[2, i], K[2, i + 1], K[3, i], K[3, i + 1]


@compiled
def friction_rate(slopes, share1, share2):
    """λ [1/s]: how fast friction stops a slow motion, the larger eigenvalue of the slopes, of which a share is left in
    each joint; inf where the inertia vanishes."""
    a11, a12, a21, a22 = share1 * slopes[0], share2 * slopes[1], share1 * slopes[2], share2 * slopes[3]
    half = 0.5 * (a11 + a22)
    rate = abs(half) + math.sqrt(max(half * half - (a11 * a22 - a12 * a21), 0.0))
    return rate if rate >= 0.0 else math.inf


@compiled
def substep(r, rate, longest):
    """Longest Runge–Kutta step [s] that keeps a friction of sharpness r [s/rad] and rate λ [1/s] resolved, at most
    `longest`.

    The friction's sign changes within |q̇| < 1/r; a step that jumps it is an error which looks like a missing
    effect. The rule 1 ms · (100/r)^0.6 keeps that error below a tenth of a 4096-count encoder's noise over 0.4 s.
    Filters take such a change in steps of its own instead, see `sign_changes`.

    Where the arm is light for its friction, the rate bounds the step further: h λ ≤ 1. At h λ = 5 the error of a
    prediction 0.3 s ahead is a count of an 8192-count encoder, at 1 a hundredth or less.
    """
    return min(longest, 1e-3 * (100.0 / max(r, 1.0)) ** 0.6, _STEP_TIMES_RATE / max(rate, 1e-9))


@compiled
def response_rate(p, codes, rows):
    """1/T [1/s] of the active effect that filters the command; 0 where none does, or at once.

    p: parameters of a plant as packed, codes: its effects, rows: of its state."""
    P, X = np.empty((p.shape[0], 1)), np.zeros((rows, 1))
    P[:, 0] = p
    u, since, reached = np.ones(1), np.full(1, _MOMENT), np.zeros(1)
    if not filter_command(u, since, X, P, codes, reached) or reached[0] >= 1.0:
        return 0.0
    return -math.log(1.0 - reached[0]) / _MOMENT


@compiled
def fitted_step(rate, response, coarser):
    """Longest Runge–Kutta step [s] of a filter, whose plant is being fitted, between changes of friction's sign.

    rate [1/s]: of friction, λ. response [1/s]: of a filter of the command. coarser: factor on the step, above 1 for a
    first look, as far as h λ ≤ 1.5. A much longer step takes a sixth of itself for the time of the command's filter."""
    product = _AT_FIRST if coarser > 1.0 else _STEP_TIMES_RATE
    longest = min(coarser * LONGEST_FITTED, LONGEST_AT_FIRST)
    step = max(SHORTEST_FITTED, min(longest, product / max(rate, 1e-9)))
    return min(step, max(_SHORTEST_RESPONSE, _STEP_TIMES_RESPONSE / response)) if response > 0.0 else step


@compiled
def moving_step(p, codes, rows, r1, r2, response, coarser):
    """`fitted_step` while both joints move too fast for their dry friction to change.

    p: parameters of a plant as packed, codes: its effects, rows: of its state, r1, r2 [s/rad]: its sharpness."""
    slopes = _slopes(p, codes, rows, _CONSTANT / r1, _CONSTANT / r2)
    return fitted_step(friction_rate(slopes, 1.0, 1.0), response, coarser)
