"""Embedded Runge–Kutta steps of orders 5 and 4 (Dormand and Prince 1980) with step control and stick–slip events.

A slipping axis that reaches zero speed, and a stuck axis whose holding torque reaches the static level, end the
step at that instant (bisection of the step, to 1e-13 s); then the mode changes and integration goes on.
"""

import math

from .compiled import compiled
from .fields import N_STATES, Q1, QM, V1, V2, VM
from .forces import arm_level, derivative, pendulum_level

RTOL = 1e-8
ATOL = 1e-10
SHORTEST = 1e-9  # s; a step that the error control would make shorter is taken as it is
MOST_STEPS = 5_000  # in one call; a motion that needs more has left all bounds
N_WORK = 9  # rows of work space: seven stages, the trial state, the state of a stage


@compiled
def _trial(t, h, x, tau, n1, n2, s1, s2, params, link, work):
    """One step from x; the result is work[7]. Returns its error over the tolerance."""
    k, y, z = work, work[7], work[8]
    derivative(t, x, tau, n1, n2, s1, s2, params, link, k[0])
    for i in range(N_STATES):
        z[i] = x[i] + h * 0.2 * k[0, i]
    derivative(t + 0.2 * h, z, tau, n1, n2, s1, s2, params, link, k[1])
    for i in range(N_STATES):
        z[i] = x[i] + h * (3.0 / 40.0 * k[0, i] + 9.0 / 40.0 * k[1, i])
    derivative(t + 0.3 * h, z, tau, n1, n2, s1, s2, params, link, k[2])
    for i in range(N_STATES):
        z[i] = x[i] + h * (44.0 / 45.0 * k[0, i] - 56.0 / 15.0 * k[1, i] + 32.0 / 9.0 * k[2, i])
    derivative(t + 0.8 * h, z, tau, n1, n2, s1, s2, params, link, k[3])
    for i in range(N_STATES):
        z[i] = x[i] + h * (
            19372.0 / 6561.0 * k[0, i]
            - 25360.0 / 2187.0 * k[1, i]
            + 64448.0 / 6561.0 * k[2, i]
            - 212.0 / 729.0 * k[3, i]
        )
    derivative(t + 8.0 / 9.0 * h, z, tau, n1, n2, s1, s2, params, link, k[4])
    for i in range(N_STATES):
        z[i] = x[i] + h * (
            9017.0 / 3168.0 * k[0, i]
            - 355.0 / 33.0 * k[1, i]
            + 46732.0 / 5247.0 * k[2, i]
            + 49.0 / 176.0 * k[3, i]
            - 5103.0 / 18656.0 * k[4, i]
        )
    derivative(t + h, z, tau, n1, n2, s1, s2, params, link, k[5])
    for i in range(N_STATES):
        y[i] = x[i] + h * (
            35.0 / 384.0 * k[0, i]
            + 500.0 / 1113.0 * k[2, i]
            + 125.0 / 192.0 * k[3, i]
            - 2187.0 / 6784.0 * k[4, i]
            + 11.0 / 84.0 * k[5, i]
        )
    derivative(t + h, y, tau, n1, n2, s1, s2, params, link, k[6])
    worst = 0.0
    for i in range(N_STATES):
        error = h * (
            71.0 / 57600.0 * k[0, i]
            - 71.0 / 16695.0 * k[2, i]
            + 71.0 / 1920.0 * k[3, i]
            - 17253.0 / 339200.0 * k[4, i]
            + 22.0 / 525.0 * k[5, i]
            - 1.0 / 40.0 * k[6, i]
        )
        worst = max(worst, abs(error) / (ATOL + RTOL * max(abs(x[i]), abs(y[i]))))
    return worst


@compiled
def _freed(hold, level, asymmetry):
    """Direction in which an axis that needs the torque `hold` to stay at rest starts to move; 0 if it stays."""
    push = -hold
    if push > level + asymmetry:
        return 1
    if -push > level - asymmetry:
        return -1
    return 0


@compiled
def _next_modes(t, x, tau, n1, n2, s1, s2, params, link, work, axis):
    """Modes that the stuck axes take next, given the torques that they need (0: stay stuck)."""
    p = params[0]
    lam1, lam2 = derivative(t, x, tau, n1, n2, s1, s2, params, link, work[0])
    if s1 == 0:
        at = x[QM] if axis == VM else x[Q1]
        s1 = _freed(lam1, p.static1 * arm_level(t, at, 0.0, p), p.asym1)
    if s2 == 0:
        s2 = _freed(lam2, p.static2 * pendulum_level(0.0, p), p.asym2)
    return s1, s2


@compiled
def _event(t, y, tau, n1, n2, s1, s2, params, link, work, axis):
    """True if a slipping axis has passed through rest in y, or a stuck one would have been freed."""
    if s1 * y[axis] < 0.0 or s2 * y[V2] < 0.0:
        return True
    if s1 != 0 and s2 != 0:
        return False
    a, b = _next_modes(t, y, tau, n1, n2, s1, s2, params, link, work, axis)
    return a != s1 or b != s2


@compiled
def advance(t, t_end, x, modes, tau, n1, n2, params, link, work, h):
    """Move x (N_STATES,) and modes (2,) from t to t_end in place, with the torques held. Returns the next step's
    length to try. work: (N_WORK, N_STATES). A motion that cannot be followed ends as NaN."""
    p = params[0]
    hard = p.hard != 0
    axis = VM if p.friction_at_motor != 0 else V1
    s1, s2 = modes[0], modes[1]
    tries = 0
    while t_end - t > 1e-13:
        tries += 1
        if tries > MOST_STEPS:
            x[:] = math.nan
            break
        if hard and (s1 == 0 or s2 == 0):
            s1, s2 = _next_modes(t, x, tau, n1, n2, s1, s2, params, link, work, axis)
        step = min(h, t_end - t)
        error = _trial(t, step, x, tau, n1, n2, s1, s2, params, link, work)
        if error > 1.0 and step > SHORTEST:
            h = max(SHORTEST, step * max(0.2, 0.9 * error**-0.2))
            continue
        grown = step * min(5.0, 0.9 * max(error, 1e-8) ** -0.2)
        h = grown if step == h else max(h, grown)
        if hard and _event(t + step, work[7], tau, n1, n2, s1, s2, params, link, work, axis):
            before, after = 0.0, step
            while after - before > 1e-13 and after > SHORTEST:
                middle = 0.5 * (before + after)
                _trial(t, middle, x, tau, n1, n2, s1, s2, params, link, work)
                if _event(t + middle, work[7], tau, n1, n2, s1, s2, params, link, work, axis):
                    after = middle
                else:
                    before = middle
            step = after
            _trial(t, step, x, tau, n1, n2, s1, s2, params, link, work)
            x[:] = work[7]
            if s1 * x[axis] < 0.0:
                x[axis], s1 = 0.0, 0
            if s2 * x[V2] < 0.0:
                x[V2], s2 = 0.0, 0
            s1, s2 = _next_modes(t + step, x, tau, n1, n2, s1, s2, params, link, work, axis)
        else:
            x[:] = work[7]
        t += step
    modes[0], modes[1] = s1, s2
    return h
