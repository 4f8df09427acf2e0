"""Where an effect starts whose law is nearly that of one that has been fitted: a spring is a cable that does not
stiffen, and a hysteresis without Coulomb friction beside it is an arm that gives before it slides. A descent from other
parameters may end far from there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from furuta_gym.plant import EFFECTS, THETA_NAMES, Effect, EffectType, Plant

from ...kalman.coordinates import Zeros
from ...kalman.record import Record
from ..policy import DecisionPolicy

_ANGLES = 60  # at which two laws are compared
_COULOMB = THETA_NAMES.index("theta8")
_FLAT = 1e-9  # of a torque's size: a smaller deviation is rounding
Array = NDArray[np.float64]


def related(one: str, other: str) -> bool:
    """Whether the law of one effect includes that of the other, or both include a third, as functions of the arm's
    angle alone."""
    laws = [{name, *EFFECTS[name].includes} for name in (one, other)]
    return one != other and bool(laws[0] & laws[1]) and all(EFFECTS[name].of_angle_alone for name in (one, other))


def nearest(effect: Effect, start: Effect, angles: Array) -> Effect:
    """The effect of the name of `start`, a related one, whose torque is nearest to that of `effect` at some angles
    (N,) [rad] of the arm. start: parameters from which it is looked for, besides those that both laws share; they
    stay where the effect is constant at these angles, as a cable is that comes taut beyond them."""
    kind = start.type
    if (same := kind.includes.get(effect.name)) is not None:
        values = same(effect.parameters, kind.neutral())
        if all(p.lower <= values[p.name] <= p.upper for p in kind.parameters):
            return Effect(start.name, values)
    wanted = _torque(effect.type, effect.parameters, angles)
    scale = float(np.std(wanted))
    if scale <= _FLAT * np.abs(wanted).max():
        return start
    names = [p.name for p in kind.parameters]
    bounds = [p.lower for p in kind.parameters], [p.upper for p in kind.parameters]

    def short(values: Array) -> Array:
        return (_torque(kind, dict(zip(names, values, strict=True)), angles) - wanted) / scale

    shared = {n: v for n, v in effect.parameters.items() if n in names}
    tried = [
        least_squares(short, np.clip([from_[n] for n in names], *bounds), bounds=bounds, x_scale="jac")
        for from_ in (dict(start.parameters), dict(start.parameters) | shared)
    ]
    best = min(tried, key=lambda found: found.cost)
    return Effect(start.name, dict(zip(names, map(float, best.x), strict=True)))


def in_place_of_friction(plant: Plant, name: str, other: str, policy: DecisionPolicy) -> Plant | None:
    """The plant with `other` in place of one of its effects, `name`, where that one has taken the place of the arm's
    Coulomb friction and is the other one then; None elsewhere."""
    effect, same = plant.effect(name), EFFECTS[other].friction_of.get(name)
    if effect is None or same is None:
        return None
    level, values = same(effect.parameters)
    θ8 = float(plant.theta[_COULOMB])
    if θ8 > policy.no_friction * (θ8 + level):
        return None
    theta = plant.theta.copy()
    theta[_COULOMB] += level
    taken = Effect(other, {**EFFECTS[other].neutral(), **values})
    return plant.without(name).replace(theta=theta).with_effects(taken)


def angles_of(records: Sequence[Record], zeros: Zeros) -> Array:
    """Angles (N,) [rad] of the arm in some records, from the least to the largest, as often as it is there."""
    read = [record.y[:, 0] - zeros.get(record.log, (0.0, 0.0))[0] for record in records]
    return np.quantile(np.concatenate(read), np.linspace(0.0, 1.0, _ANGLES))


def _torque(kind: EffectType, values: Mapping[str, float], angles: Array) -> Array:
    kernel, arguments = kind.kernels["torque"], kind.arguments["torque"]
    return np.array([kernel(*(q1 if name == "q1" else values[name] for name in arguments))[0] for q1 in angles])
