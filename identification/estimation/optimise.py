"""Levenberg–Marquardt (Fisher scoring) within bounds."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..normal_equations import ScaledGram

TOLERANCE = 0.01
"""Decrease [nats] that the quadratic model promises, below which a fit has converged."""
_POLISH = 1.0  # nats: gain below which frozen gains give way to exact derivatives
_UNSEEN = 0.5  # nats that exact derivatives may promise where no step of any length comes lower: one deviation at most


@dataclass
class Expansion:
    """V at z, its gradient (n,) and Fisher information (n, n); per-sample scores (N, n) of every record if asked."""

    value: float
    gradient: NDArray[np.float64]
    information: NDArray[np.float64]
    scores: list[NDArray[np.float64]] | None = None


class Problem(Protocol):
    """An objective V(z) in nats, within bounds. noisy (n,): which coordinates are logarithms of variances.

    `moved` is where a step ends: at z + step, or near it where a curve leads lower. `axes` (n, n) has in its columns
    the directions that damping holds back, each by its own curvature; parameters that imitate each other are slow in
    any others. `reach` (n,) is how far a single step may lead in each coordinate."""

    low: NDArray[np.float64]
    high: NDArray[np.float64]
    noisy: NDArray[np.bool_]

    def value(self, z: NDArray[np.float64]) -> float: ...

    def expand(
        self, z: NDArray[np.float64], exact: bool = False, scores: bool = False, central: bool = False
    ) -> Expansion: ...

    def moved(
        self, z: NDArray[np.float64], step: NDArray[np.float64], information: NDArray[np.float64]
    ) -> NDArray[np.float64]: ...

    def axes(self, z: NDArray[np.float64]) -> NDArray[np.float64]: ...

    def reach(self, z: NDArray[np.float64]) -> NDArray[np.float64]: ...


@dataclass(frozen=True)
class Optimum:
    """Where a minimisation ended: z, V there, its expansion, iterations, and whether and why it stopped."""

    z: NDArray[np.float64]
    value: float
    expansion: Expansion
    iterations: int
    converged: bool
    message: str


def minimise(
    problem: Problem,
    z: NDArray[np.float64],
    iterations: int = 40,
    tolerance: float = TOLERANCE,
    free=None,
    exact: bool = True,
) -> Optimum:
    """Levenberg–Marquardt on V from z, within the bounds. `free`: indices that move (default all).

    Goes with frozen gains while they bring V down, then, if `exact`, with exact derivatives to the minimum: differences
    to both sides, as one-sided ones lead astray where parameters imitate each other. Stops when the decrease of V that
    the quadratic model promises (a log-likelihood: absolute, in nats) is below `tolerance`, or two steps in a row
    brought less. With `exact` the expansion returned is exact, unless the iterations ended before.
    """
    free = np.arange(len(z)) if free is None else np.asarray(free)
    z = np.clip(z, problem.low, problem.high)
    damping, polishing, small = 1e-3, False, 0
    expansion = problem.expand(z)
    if not math.isfinite(expansion.value):
        return Optimum(z, math.inf, expansion, 0, False, "the filter diverges at the start values")
    for iteration in range(1, iterations + 1):
        trial, there, predicted, damping = _descend(problem, z, expansion, free, damping, tolerance, polishing)
        if trial is None:  # nothing lower on the way the derivatives show
            # closer than that the quadratic model itself is not
            done = predicted < 10.0 * tolerance or (polishing and predicted < _UNSEEN)
            if polishing or not exact:
                message = "converged" if done else "no further descent"
                return Optimum(z, expansion.value, expansion, iteration, done, message)
            polishing, damping = True, 1e-3
        else:
            z = trial
            assert there is not None
            small = small + 1 if expansion.value - there.value < tolerance else 0
            polishing = exact and (polishing or expansion.value - there.value < _POLISH)
        if polishing or there is None:
            there = problem.expand(z, exact=polishing, central=polishing)
        expansion = there
        if small >= 2 and (polishing or not exact):
            return Optimum(z, expansion.value, expansion, iteration, True, "converged")
    return Optimum(z, expansion.value, expansion, iterations, False, f"not converged in {iterations} iterations")


def promised(problem: Problem, found: Optimum) -> float:
    """Decrease [nats] that the quadratic model promises from where a minimisation ended."""
    z, there = found.z, found.expansion
    ridged = _ridged(there.information, problem.reach(z))
    return _hoped(problem, z, there.gradient, ridged, np.arange(len(z)))[0]


_RIDGE = 0.1  # nats a square `reach`: a coordinate that the data hardly see (a vanishing noise) stays about where it is


_NEAR = 1000.0  # nats that a step promises, below which it is tried undamped: damping holds back what data hardly see
_CURVED = 1.0  # nats that a step promises, from which the way back to a valley's floor is worth its derivatives
_FAR = 30.0  # times what a step promises: beyond it a trial is too far off the valley's floor to go back
_SHARES = np.array([1.0, 0.3, 0.1])  # of that step, as the valley may bend
_TRIES = 12  # of damping
_LEAST = 1e-12  # of a diagonal of the information
_ROUNDING = 1e-14  # of scaled information: what lies below is no curvature


def _descend(problem, z, expansion, free, damping, tolerance, polishing):
    """One step that lowers V: (trial, expansion there, promised decrease, damping); trial is None if there is none.

    Most steps with frozen gains succeed, and their expansion costs little more than V alone; exact ones are dear, so
    V alone decides there (`expansion.information` of such a trial is not to be used).
    """
    g, H = expansion.gradient, expansion.information
    axes, reach = problem.axes(z), problem.reach(z)
    ridged = _ridged(H, reach)
    hoped, move = _hoped(problem, z, g, ridged, free)
    if hoped < tolerance:
        return None, None, hoped, damping
    near = polishing and hoped < _NEAR
    straight = _bounded_step(z, g, ridged, move, 0.0, problem.low, problem.high, axes) if near else np.zeros_like(z)
    for share in _SHARES / _excess(straight, reach, ~problem.noisy) if near else ():
        moved = share * straight
        trial = problem.moved(z, moved, H)
        there = replace(expansion, value=problem.value(trial))
        if hoped > _CURVED and -_FAR * hoped < expansion.value - there.value <= 0.5 * share * hoped:
            trial = _back(problem, trial, problem.expand(trial, exact=True, central=True), g + H @ moved, move)
            there = replace(expansion, value=problem.value(trial))
        if expansion.value - there.value > 0.5 * share * hoped:
            return trial, there, hoped, damping
    for tries in range(_TRIES):
        moved = _bounded_step(z, g, ridged, move, damping, problem.low, problem.high, axes)
        predicted = -float(g @ moved + 0.5 * moved @ H @ moved)
        # for a variance the scoring step is ratio − 1, and what it aims at is the logarithm of that ratio
        shorter = moved / _excess(moved, reach, ~problem.noisy)
        moved = np.where(problem.noisy, np.log1p(np.clip(moved, -0.95, 20.0)), shorter)
        trial = problem.moved(z, moved, H)
        there = replace(expansion, value=problem.value(trial)) if polishing else problem.expand(trial)
        if not polishing and tries == 0 and expansion.value <= there.value < math.inf:
            trial = _back(problem, trial, there, g + H @ moved, move)
            there = problem.expand(trial)
        if there.value < expansion.value:
            gained = expansion.value - there.value > 0.5 * predicted
            easier = 1.0 if tries else 0.1  # not at once back to what has just failed
            return trial, there, hoped, damping * easier if gained else damping * 2.0
        damping = max(10.0 * damping, 1e-4)
    return None, None, hoped, damping


def _hoped(problem, z, g, ridged, free):
    """The decrease that an undamped step promises, and the coordinates that it moves: not those held at a bound."""
    held = (z <= problem.low) & (g > 0) | (z >= problem.high) & (g < 0)
    move = np.array([i for i in free if not held[i]], dtype=int)
    return ScaledGram.of(ridged[np.ix_(move, move)], _LEAST).gain(g[move], _ROUNDING).gain, move


def _back(problem, trial, there, expected, move):
    """The trial moved back to the bottom of a curved valley that a straight step has left: a Gauss–Newton step on what
    the gradient there has beyond what that step expected."""
    beyond = there.gradient - expected
    reach = problem.reach(trial)
    ridged = _ridged(there.information, reach)
    back = _bounded_step(trial, beyond, ridged, move, 0.0, problem.low, problem.high, problem.axes(trial))
    return problem.moved(trial, back / _excess(back, reach), there.information)


def _ridged(H, reach):
    """The information with the ridge."""
    return H + np.diag(_RIDGE / reach**2)


def _excess(step, reach, of=slice(None)):
    """How many times longer than its reach a step is in the coordinate where it is most so, 1 at least."""
    return np.abs(step / reach)[of].max(initial=1.0)


def _bounded_step(z, g, H, move, damping, low, high, axes):
    """The damped Gauss–Newton step of the coordinates `move`, by the ridged information H; those that would pass a
    bound go to it, and the others make the best of that."""
    step = np.zeros_like(z)
    while len(move):
        own = axes[np.ix_(move, move)]
        A = own.T @ H[np.ix_(move, move)] @ own
        right = own.T @ (g[move] + H[move] @ step)
        scaled = ScaledGram.of(A, _LEAST)
        damped = scaled.matrix + max(damping, _ROUNDING) * np.eye(len(move))
        wanted = -own @ (np.linalg.solve(damped, right / scaled.scale) / scaled.scale)
        out = (z[move] + wanted < low[move]) | (z[move] + wanted > high[move])
        if not out.any():
            step[move] = wanted
            break
        step[move[out]] = np.clip(z[move] + wanted, low[move], high[move])[out] - z[move[out]]
        move = move[~out]
    return step
