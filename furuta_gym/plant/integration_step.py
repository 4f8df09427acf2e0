"""How long a Runge–Kutta step may be: the one rule, of friction's sharpness and of how fast friction stops a motion."""

import math

from .compiled import compiled

_STEP_TIMES_RATE = 1.5  # of friction
_STABLE = 2.5  # the same, for a first look; classical Runge–Kutta is stable up to 2.78
_SHORTEST = 5e-5  # s, where θ is being fitted and may go astray


@compiled
def friction_rate(theta, r1, r2):
    """λ [1/s]: how fast friction stops a slow motion near upright, the largest eigenvalue of M⁻¹ (F_v + F_c r).

    theta: θ1 … θ9, in the rows of any array. r1, r2 [s/rad]: the friction's sharpness. M at q2 = 0, where the
    inertia is the least."""
    d1, d2 = abs(theta[5]) + abs(theta[7]) * r1, abs(theta[6]) + abs(theta[8]) * r2
    det = max(theta[0] * theta[3] - theta[2] * theta[2], 1e-12 * theta[0] * theta[3])
    half = 0.5 * (theta[3] * d1 + theta[0] * d2) / det
    return half + math.sqrt(max(half * half - d1 * d2 / det, 0.0))


@compiled
def substep(r, rate, longest):
    """Longest Runge–Kutta step [s] that keeps a friction of sharpness r [s/rad] and rate λ [1/s] resolved, at most
    `longest`.

    The friction's sign changes within |q̇| < 1/r; a step that jumps it is an error which looks like a missing
    effect. The rule 1 ms · (100/r)^0.6 keeps that error below a tenth of a 4096-count encoder's noise over 0.4 s. From
    the usual r = 100 to 130 the step stays as it is: one more in a sample changes a likelihood by tens of nats, and an
    estimate of r near 100 would take that for evidence.

    Where the arm is light for its friction, the rate bounds the step further: h λ ≤ 1.5. At h λ = 5 the error of a
    prediction 0.3 s ahead is a count of an 8192-count encoder, at 1.5 a hundredth.
    """
    resolved = r if r < 100.0 else max(100.0, r / 1.3)
    return min(longest, 1e-3 * (100.0 / max(resolved, 1.0)) ** 0.6, _STEP_TIMES_RATE / max(rate, 1e-9))


@compiled
def fitted_step(theta, r1, r2, longest, coarser):
    """`substep` [s] for a θ that is being fitted. coarser: factor on it for a first look, as far as that is stable."""
    rate = friction_rate(theta, r1, r2)
    step = max(_SHORTEST, substep(max(r1, r2), rate, longest))
    return max(step, min(coarser * step, _STABLE / max(rate, 1e-9)))
