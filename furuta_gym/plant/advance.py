"""States carried from sample to sample (`integration`) under commands that are held, or that come late."""

import math

import numpy as np

from .compiled import compiled
from .effects.dispatch import command_delays, filter_command, map_command, store_filter
from .integration import runge_kutta
from .layout import N_BASE


@compiled(forceinline=True)
def acting_row(given, newest, oldest, delay, t):
    """Row of the command that acts at t [s], if each comes `delay` seconds after it was given.

    given: times [s] of the commands, of which rows newest … oldest (either end may be the larger one) are looked at,
    backwards from the newest. The oldest acts where none has come yet.
    """
    back = 1 if oldest > newest else -1
    row = newest
    while row != oldest and given[row] + delay > t:
        row += back
    return row


@compiled(forceinline=True)
def until_next(given, delay, start, end):
    """Until when in [start, end] the present command acts, if the next was given at `given` and comes `delay` later."""
    return max(start, min(end, given + delay))


@compiled
def advance(X, t0, t1, t_u, U, j, W, P, codes, h_max):
    """Carry X from t0 to t1 [s] in place, the commands being held from sample to sample.

    t_u (H,) are the times from which the commands U (H, L or 1) hold, and j is the row that holds from t0 when
    nothing delays it; rows before j are its past (before the first row the first command is taken to have held).
    W (2, L) are disturbance torques on the two rows, constant over the interval. Each stretch under one command is
    cut into equal Runge–Kutta steps no longer than h_max.
    """
    work, state, source = workspace(X.shape[0], X.shape[1])
    advance_within(X, t0, t1, t_u, U, j, W, P, codes, h_max, work, state, source)


@compiled
def workspace(rows, lanes):
    """What `advance_within` works in, for whoever calls it again and again: (work, state, source).

    Rows of work: a stage's states, their rates and sums of rates (rows each), TH, the two torques; then the times since
    the step began, torques of the motor, times, and how long the command lasts.
    """
    return np.empty((3 * rows + N_BASE + 6, lanes)), np.empty((5, lanes)), np.empty(lanes, np.int64)


@compiled(borrows=True)
def advance_within(X, t0, t1, t_u, U, j, W, P, codes, h_max, work, state, source):
    """`advance` in a `workspace` made before."""
    lanes = X.shape[1]
    start, h, command, delay, stop = state[0], state[1], state[2], state[3], state[4]
    if not command_delays(P, codes, delay):
        n = max(1, math.ceil((t1 - t0) / h_max - 1e-6))
        for k in range(lanes):
            start[k] = t0
            h[k] = (t1 - t0) / n
            command[k] = U[j, k if U.shape[1] > 1 else 0]
            work[-1, k] = t1 - t0
        _stretch(X, start, h, n, command, W, P, codes, work)
        return
    for k in range(lanes):
        start[k] = t0
        source[k] = acting_row(t_u, j, 0, delay[k], t0)
    done = False
    while not done:
        longest = 0.0
        for k in range(lanes):
            stop[k] = t1
            if source[k] < j:
                stop[k] = until_next(t_u[source[k] + 1], delay[k], start[k], t1)
            longest = max(longest, stop[k] - start[k])
            command[k] = U[source[k], k if U.shape[1] > 1 else 0]
        n = max(1, math.ceil(longest / h_max - 1e-6))
        for k in range(lanes):
            h[k] = (stop[k] - start[k]) / n
            work[-1, k] = stop[k] - start[k]
        _stretch(X, start, h, n, command, W, P, codes, work)
        done = True
        for k in range(lanes):
            start[k] = stop[k]
            if stop[k] < t1:
                source[k] += 1
                done = False


@compiled(borrows=True, forceinline=True)
def _stretch(X, start, h, n, command, W, P, codes, work):
    """A stretch under one command: n steps of h (L,) seconds from start (L,); work[-1] says how long it lasts."""
    tau, lasts = work[-3], work[-1]
    map_command(P, codes, command)
    runge_kutta(X, start, h, n, command, W, P, codes, work)
    filter_command(command, lasts, X, P, codes, tau)
    store_filter(X, codes, tau)
