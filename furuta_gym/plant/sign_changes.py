"""Integration across a change of friction's sign, for lanes that move alike, as the filters of one log do.

Friction tanh(r q̇) turns over while |q̇| < 3/r. A joint that swings passes there in less than a Runge–Kutta step, and
each of the step's four stages sees the old sign or the new one. The error is a small push. An estimate takes a row of
such pushes for a friction of another sharpness. So the passage is found, and taken in shorter steps.
"""

import math

from .advance import advance_within
from .compiled import compiled
from .integration import shared_steps

_PIECE = 2e-3  # s, in which a velocity changes nearly evenly
_EDGE = 3.0  # of r q̇: beyond it friction is constant to half a percent
_CHANGE = 0.5  # of r q̇ in a step, at most
_MARGIN = 0.1  # of a piece, as the velocity does not change quite evenly
_MOST = 64  # steps in a passage


@compiled
def passage(before, after, r, steps):
    """(begin, end, step): where in a piece friction turns over, and the step it needs, as fractions of the piece.

    before, after: the velocity [rad/s] at both ends. r [s/rad]: the friction's sharpness. begin ≥ end where it does
    not turn over, or where `steps` equal steps resolve it."""
    change = r * abs(after - before)
    if not change > _CHANGE * steps:
        return 1.0, 0.0, 1.0
    middle, half = before / (before - after), _EDGE / change + _MARGIN
    return max(0.0, middle - half), min(1.0, middle + half), _CHANGE / change


@compiled
def _both(first, second):
    """The part of a piece that holds both passages, in the shorter of their steps."""
    if not second[0] < second[1]:
        return first
    if not first[0] < first[1]:
        return second
    return min(first[0], second[0]), max(first[1], second[1]), min(first[2], second[2])


@compiled
def _moving(X, r1, r2):
    """Whether dry friction of both joints is constant at these states of lane 0."""
    return r1 * abs(X[2, 0]) > _EDGE and r2 * abs(X[3, 0]) > _EDGE


@compiled
def _onwards(before, after, travel, T):
    """Whether a velocity keeps its sign in a step of T seconds, and in each of its stages: there friction turns over
    unseen where a joint comes to a stop and moves on. travel [rad]: of the joint in the step.

    Half of what the acceleration changes by from the first stage to the last, times T, is 6 (travel/T − (before +
    after)/2). The end moved by it is where the first stage's acceleration leads; the beginning is moved the other way,
    and the end as far on as the step led."""
    bend = 6.0 * (travel / T - 0.5 * (before + after))
    same = before * after > 0.0 and before * (after + bend) > 0.0
    return same and before * (before - bend) > 0.0 and before * (2.0 * after - before) > 0.0


@compiled
def _copied(to, X):
    for row in range(X.shape[0]):
        for k in range(X.shape[1]):
            to[row, k] = X[row, k]


@compiled
def _advance(X, t0, t1, steps, t_u, U, j, W, P, codes, plain, work, state, source):
    if plain:
        shared_steps(X, U[j, 0], (t1 - t0) / steps, steps, P)
    else:
        advance_within(X, t0, t1, t_u, U, j, W, P, codes, (t1 - t0) / steps, work, state, source)


@compiled
def advance_alike(X, t0, t1, t_u, U, j, W, P, codes, h_max, h_moving, r1, r2, plain, kept, work, state, source):
    """`advance_within`, in shorter steps where the friction of lane 0 changes its sign, and in longer ones where it is
    constant.

    h_max, h_moving [s]: the longest step near rest, and where both joints move. r1, r2 [s/rad]: the sharpness of both
    joints' friction. plain: no effect acts, nor any torque W. kept: work space of X's shape."""
    h_moving = max(h_max, h_moving)
    pieces = max(1, math.ceil((t1 - t0) / max(_PIECE, h_moving) - 1e-6))
    T = (t1 - t0) / pieces
    steps = max(1, math.ceil(T / h_max - 1e-6))
    long = max(1, math.ceil(T / h_moving - 1e-6))
    for i in range(pieces):
        start = t0 + i * T
        _copied(kept, X)
        if long < steps and _moving(X, r1, r2):
            _advance(X, start, start + T, long, t_u, U, j, W, P, codes, plain, work, state, source)
            on = _moving(X, r1, r2)
            for joint in range(2):
                travel = X[joint, 0] - kept[joint, 0]
                on = on and _onwards(kept[2 + joint, 0], X[2 + joint, 0], travel, T)
            if on:
                continue
            _copied(X, kept)
        _advance(X, start, start + T, steps, t_u, U, j, W, P, codes, plain, work, state, source)
        begin, end, step = _both(passage(kept[2, 0], X[2, 0], r1, steps), passage(kept[3, 0], X[3, 0], r2, steps))
        if not begin < end:
            continue
        _copied(X, kept)
        first, second = start + begin * T, start + end * T
        if begin > 0.0:
            before = math.ceil(begin * steps)
            _advance(X, start, first, before, t_u, U, j, W, P, codes, plain, work, state, source)
        within = min(_MOST, max(1, math.ceil((end - begin) / step)))
        _advance(X, first, second, within, t_u, U, j, W, P, codes, plain, work, state, source)
        if end < 1.0:
            after = math.ceil((1.0 - end) * steps)
            _advance(X, second, start + T, after, t_u, U, j, W, P, codes, plain, work, state, source)
