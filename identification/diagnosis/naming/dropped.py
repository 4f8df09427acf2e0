"""Where a fit without one of its effects starts: what the others most likely are then.

Two effects may imitate each other on some logs, as an offset of the command and a friction that differs by direction do
while the arm turns one way. Then each has any share of what they explain together, and without one of them the other
must take over its share. A descent that starts with the rest of the plant as it is may not find that.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from furuta_gym.plant import Effect, Plant

from ...estimation.uncertainty import inverse_information
from ...kalman.coordinates import Zeros
from .fits import Fit

_LARGEST = 3.0
"""How far a coordinate may move where a first order is believed: a factor of twenty, or three scales."""


@dataclass(frozen=True)
class Remainder:
    """A plant, and the zeros of the encoders [rad] in each log, from which a fit starts."""

    plant: Plant
    zeros: Zeros = field(default_factory=dict)


def dropped(fitted: Fit, name: str) -> Remainder:
    """Where a fit starts without one effect of another fit. An effect of which that one is a special case takes its
    part over. Else the rest stays as it is, or goes where the information of the fit has it if the dropped effect does
    nothing: whichever is likelier."""
    gone = fitted.plant.effect(name)
    assert gone is not None
    rest = tuple(_with_part_of(gone, e) for e in fitted.plant.effects if e.name != name)
    as_it_is = Remainder(fitted.plant.replace(effects=rest), fitted.zeros)
    if any(gone.name in e.type.includes for e in rest):
        return as_it_is
    return _likelier(fitted, gone) or as_it_is


def _likelier(fitted: Fit, gone: Effect) -> Remainder | None:
    """Where the rest of a fit most likely is if an effect does nothing: the mean of the others in the normal
    distribution that the information describes. None if it is likelier to stay where it is, if the sizes of the effect
    have no finite value of doing nothing, or if that is too far away."""
    neutral = {f"{gone.name}.{p.name}": p.neutral for p in gone.type.parameters if p.role == "size" and not p.integer}
    at = [i for i, c in enumerate(fitted.coordinates) if c.name in neutral]
    if not at or any(fitted.coordinates[i].log or not np.isfinite(neutral[fitted.coordinates[i].name]) for i in at):
        return None
    z = fitted.optimum.z
    target = np.array([fitted.coordinates[i].to_z(neutral[fitted.coordinates[i].name]) for i in at])
    covariance = inverse_information(fitted.optimum.expansion.information)
    shift = covariance[:, at] @ np.linalg.lstsq(covariance[np.ix_(at, at)], target - z[at], rcond=None)[0]
    others = np.array([not c.noise and c.name.partition(".")[0] != gone.name for c in fitted.coordinates])
    shift = np.where(others, shift, 0.0)
    if not np.all(np.isfinite(shift)) or np.abs(shift).max() > _LARGEST:
        return None
    problem = fitted.problem()
    still = z.copy()
    still[at] = target
    there = np.clip(still + shift, problem.low, problem.high)
    try:
        plant = problem.plant_at(there)
    except ValueError:  # the mass matrix is not positive definite there
        return None
    if not problem.value(there) < problem.value(still):
        return None
    return Remainder(plant.without(gone.name), problem.zeros_at(there))


def _with_part_of(gone: Effect, effect: Effect) -> Effect:
    """The effect doing what it and `gone` did, where its law includes that one's; else as it is."""
    together = effect.type.includes.get(gone.name)
    if together is None:
        return effect
    values = together(gone.parameters, effect.parameters)
    inside = all(p.lower <= values[p.name] <= p.upper for p in effect.type.parameters)
    return Effect(effect.name, values) if inside else effect
