"""Restarts of a fit that may have stalled, until none of them improves it.

The pendulum's row has no input, so θ2 … θ5, θ7 and θ9 share a scale that only the reaction on the arm fixes. Where
something large is missing at the start, that scale is dragged away, torque noise grows to explain the rest, and the
descent ends in a narrow curved valley far from the optimum. From there the way back is short for a fit that starts with
more torque noise, or with another scale.

Or the shape of an effect ends where the readings do not answer to it: a stop that never slips is a spring. Then its
grid gives other starts.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..kalman.noise_model import TORQUE
from .identifiability import PENDULUM
from .long_logs import glimpse_of
from .optimise import Optimum, minimise
from .pool import mapped
from .prediction_error import PredictionError, quietest
from .uncertainty import inverse_information

_SCALES = (1.0, 4.0, 0.25)  # times the pendulum's row
_LOUDER = 100.0  # times the torque noise
_HIDING = 10.0  # times the least torque noise, from which noise may hide that a fit has stalled
_UNDETERMINED = 2.0  # standard deviation of a logarithm: a factor of seven
_SHORT = 4  # iterations of a restart before those that are behind are dropped
_ROUGH = 1.0  # nats, of descents on a part, whose minimum is apart from that of all by several
_WORTH = 0.5  # nats, that a restart must come down by
_ROUNDS = 3


def restarted(problem: PredictionError, found: Optimum, iterations: int, tolerance: float, exact: bool) -> Optimum:
    """The optimum, or a lower one that a restart reaches. Arguments as in `minimise`.

    Nothing is tried where the fit converged with as little torque noise as can be told from none: then nothing is
    left that a stalled fit could have hidden. On long logs a part of them tells whether a restart comes lower.
    """
    if not _may_have_stalled(problem, found):
        return found
    part = glimpse_of(problem)
    if part is None:
        return _rounds(problem, found, iterations, tolerance, exact)
    there = minimise(part, found.z, iterations, _ROUGH, exact=False)
    worth = float(len(found.z))  # what other samples move the minimum by
    lower = _rounds(part, there, iterations, tolerance, exact=False, worth=worth)
    if lower.value > part.value(found.z) - worth:
        return found
    near = _best_of(problem, [lower.z], found.value, _ROUGH)
    if not near.value < found.value:
        return found  # lower on the part only
    again = minimise(problem, near.z, iterations, tolerance, exact=exact)
    return again if again.value < found.value else found


def _rounds(
    problem: PredictionError, found: Optimum, iterations: int, tolerance: float, exact: bool, worth: float = _WORTH
) -> Optimum:
    """Restarts as long as each brings V down by `worth` [nats]."""
    for _ in range(_ROUNDS):
        if not _may_have_stalled(problem, found):
            break
        starts = [_shifted(problem, found.z, scale) for scale in _SCALES] + _elsewhere(problem, found)
        best = _best_of(problem, starts, found.value - (worth - _WORTH), tolerance)
        if not best.value < found.value - worth:
            break
        again = minimise(problem, best.z, iterations, tolerance, exact=exact)
        if not again.value < found.value:
            break
        found = again
    return found


def _may_have_stalled(problem: PredictionError, found: Optimum) -> bool:
    if not math.isfinite(found.value):
        return False
    if not found.converged:
        return True
    least = quietest(problem.plant_at(found.z), problem.records)
    return bool(np.any(problem.noise_at(found.z).torque > _HIDING * least))


def _best_of(problem: PredictionError, starts: list[NDArray[np.float64]], reach: float, tolerance: float) -> Optimum:
    """The best of short fits with frozen gains. After each round the worse half is dropped, and all are once the best
    one's pace cannot reach the value `reach` in two more rounds."""
    at = [(math.inf, z) for z in starts]
    best, alone = None, problem.alone()

    def shortly(z: NDArray[np.float64]) -> Optimum:
        return minimise(alone, z, _SHORT, tolerance, exact=False)

    while at:
        ends = mapped(problem.pool, shortly, [z for _, z in at])
        fits = [(value, end) for (value, _), end in zip(at, ends, strict=True)]
        fits.sort(key=lambda item: item[1].value)
        before, first = fits[0]
        if best is None or first.value < best.value:
            best = first
        if first.converged or first.value - 2.0 * (before - first.value) > reach:
            break
        at = [
            (fitted.value, fitted.z)
            for value, fitted in fits[: (len(fits) + 1) // 2]
            if not fitted.converged and value - fitted.value > tolerance  # else it goes on where it stands, for ever
        ]
        if len(fits) == 1 and first.value < reach - _WORTH:
            break  # low enough for a full fit
    assert best is not None
    return best


def _elsewhere(problem: PredictionError, found: Optimum) -> list[NDArray[np.float64]]:
    """Starts in which a shape that the readings do not determine where it ended has each value of its grid."""
    variance = np.diag(inverse_information(found.expansion.information))
    index = {c.name: i for i, c in enumerate(problem.coordinates) if c.log and not c.noise}
    plant, starts = problem.plant_at(found.z), []
    for effect in plant.effects:
        usual = plant.default_effect(effect.name).parameters
        for p in effect.type.parameters:
            i = index.get(f"{effect.name}.{p.name}")
            if i is None or p.role != "shape" or variance[i] < _UNDETERMINED**2:
                continue
            for value in p.grid_on(usual[p.name]):
                z = found.z.copy()
                z[i] = problem.coordinates[i].to_z(value)
                starts.append(np.clip(z, problem.low, problem.high))
    return starts


def _shifted(problem: PredictionError, z: NDArray[np.float64], scale: float) -> NDArray[np.float64]:
    """More torque noise and another scale of the pendulum's row."""
    z = z.copy()
    p = {c.name: c.to_value(zi) for c, zi in zip(problem.coordinates, z, strict=True)}
    if all(name in p for name in ("theta1", "theta3", "theta4")):  # M stays positive definite
        scale = min(scale, 0.9 * p["theta1"] * p["theta4"] / p["theta3"] ** 2)
    for i, c in enumerate(problem.coordinates):
        if c.noise and c.row < TORQUE.stop:
            z[i] += math.log(_LOUDER)
        elif c.of_plant and c.name in PENDULUM:
            z[i] = z[i] + math.log(scale) if c.log else z[i] * scale
    return np.clip(z, problem.low, problem.high)
