"""Whether the law of an effect is another than the library's: whether what a fit leaves goes with the effect's own
variables.

No rig has an effect in the library's very words. What the words miss of it goes with the same things as the effect
itself: a cable's stiffness with the arm's angle, a late command with the command's changes. And it does so at the
effect's own scale: a memory at its own travel, a ripple at its own period.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import EFFECTS, THETA_NAMES, Effect, EffectType, Plant

from ...discrepancy.basis import Family, Signals, on_row, stages
from ...discrepancy.dependence import ANGLES, SPEEDS, ZEROS, Channel, Dependence, Variable
from ...friction_memory import bristle

Array = NDArray[np.float64]

_ROWS = {"arm": 0, "pendulum": 1}
_TRAVELS = (0.3, 1.0, 3.0)  # times an effect's own, of bristles
_HARMONICS = (1, 2, 3)
_BY_ANGLE = Dependence(Channel.ARM, Variable.ARM_ANGLE)
_ON_ONE_QUANTITY = {v.argument: v for v in (*ANGLES.values(), *SPEEDS.values())}
_DEGREE = 6  # of polynomials in an angle


def own_variables(name: str) -> frozenset[Dependence]:
    """What another law of an effect would go with, among the families of `locate`."""
    effect = EFFECTS[name]
    found: set[Dependence] = set()
    for hook, arguments in effect.arguments.items():
        if hook in ("delay", "filter"):
            found.add(Dependence(Channel.INPUT, Variable.COMMAND_CHANGE))
        elif hook == "command":
            found.add(Dependence(Channel.INPUT, Variable.COMMAND))
            found.add(Dependence(Channel.ARM, Variable.CONSTANT))
        elif hook == "sensor":
            found |= {Dependence(Channel.SENSOR, of[effect.reads]) for of in (ANGLES, ZEROS)}
        elif hook == "theta":
            if effect.sharpens:
                found |= {Dependence(Channel(joint), speed) for joint, speed in SPEEDS.items()}
            if "t" in arguments:
                found.add(Dependence(Channel.PENDULUM, Variable.MASSES_IN_TIME))
        elif hook == "torque":
            found |= _of_torque(effect)
    return frozenset(found)


def _of_torque(effect: EffectType) -> set[Dependence]:
    place, arguments = effect.place, set(effect.arguments["torque"])
    moving = {a for a in arguments if a[0] == "v"}
    if place == "arm and pendulum":
        if moving:  # air drag
            return {Dependence(Channel(joint), _ON_ONE_QUANTITY[a]) for joint in _ROWS for a in moving}
        tilt = (Variable.CONSTANT, Variable.ARM_ANGLE, Variable.PENDULUM_ANGLE)  # what no cable has
        return {Dependence(Channel.PENDULUM, variable) for variable in tilt}
    channel = Channel(place)
    if effect.memory:
        return {Dependence(channel, Variable.MEMORY), Dependence(channel, SPEEDS[place])}
    if effect.changes_gain:
        return {Dependence(channel, Variable.GAIN_IN_TIME)}
    if "t" in arguments:
        return {Dependence(channel, Variable.FRICTION_IN_TIME if moving else Variable.FREQUENCY)}
    if moving and "q1" in arguments:
        return {Dependence(channel, Variable.ARM_ANGLE_AND_DIRECTION)}
    return {Dependence(channel, _ON_ONE_QUANTITY[a]) for a in arguments if a in _ON_ONE_QUANTITY}


def ways(name: str, own: Iterable[Family]) -> list[frozenset[Dependence]]:
    """Sets of variables, any of which another law of an effect may go with. own: its `own_families`.

    Piecewise linear functions of an angle cost more than a polynomial where the law is smooth, and their corners show
    where a fit is near; a polynomial has no corner where the law has one.
    """
    known, found = own_variables(name), {family.dependence for family in own}
    smooth = {of for of in found if of.variable is Variable.SMOOTH_ARM_ANGLE}
    first = known | (found - smooth)
    return [frozenset(first), frozenset((first - {_BY_ANGLE}) | smooth)] if smooth else [frozenset(first)]


def own_families(name: str, plant: Plant, signals: Signals, span: tuple[float, float]) -> list[Family]:
    """Families beyond those that `locate` knows, for another law of an effect: near standstill where it goes with a
    speed, over time where it is an offset, and at the scale of its parameters where the plant has it.

    span [s]: of the log's clock.
    """
    found = []
    for channel, variable in sorted(own_variables(name)):
        if variable is SPEEDS.get(channel):
            row = _ROWS[channel]
            near = on_row(row, *_near(signals.v[:, row], plant.sharpness[row]))
            found.append(Family(channel, Variable.STANDSTILL, torque=near))
        if (channel, variable) == _BY_ANGLE:
            smooth = on_row(0, *_polynomials(signals.q[:, 0]))
            found.append(Family(Channel.ARM, Variable.SMOOTH_ARM_ANGLE, torque=smooth))
    if EFFECTS[name].constant and not EFFECTS[name].reads:
        found.append(Family(Channel.ARM, Variable.TIME, torque=on_row(0, *stages(signals.t, span))))
    effect = plant.effect(name)
    if effect is not None:
        found += _at_its_scale(effect, plant, signals)
    return found


def _polynomials(q: Array) -> list[Array]:
    """Chebyshev polynomials of an angle (N,), over its range."""
    low, high = float(q.min()), float(q.max())
    x = np.clip((2.0 * q - low - high) / max(high - low, 1e-9), -1.0, 1.0)
    return [np.polynomial.chebyshev.Chebyshev.basis(k)(x) for k in range(_DEGREE + 1)]


def _near(v: Array, r: float) -> list[Array]:
    """Functions of a speed (N,) within a few 1/r of standstill."""
    return [np.tanh(0.3 * r * v), np.tanh(3.0 * r * v), np.tanh(r * v) ** 2]


def _at_its_scale(effect: Effect, plant: Plant, s: Signals) -> list[Family]:
    p = effect.parameters
    q1, v1, t = s.q[:, 0], s.v[:, 0], s.t
    remembered = effect.type.remembered(p, float(plant.theta[THETA_NAMES.index("theta8")]))
    if travels := [d for d in remembered if d > 0.0 and math.isfinite(d)]:
        columns = [bristle(s.way(0), factor * d) for d in travels for factor in _TRAVELS]
        return [Family(Channel.ARM, Variable.OWN_TRAVEL, torque=on_row(0, *columns))]
    if periods := effect.type.periods_a_turn:
        return [Family(Channel.ARM, Variable.OWN_RIPPLE, torque=on_row(0, *_waves(p[periods] * q1)))]
    if effect.type.dry and effect.type.of_arm_angle:
        turning = np.tanh(plant.sharpness[0] * v1)
        friction = on_row(0, *(w * turning for w in _waves(q1)))
        return [Family(Channel.ARM, Variable.OWN_FRICTION, torque=friction)]
    if frequency := next((p[known.name] for known in effect.type.parameters if known.repeats), None):
        wave = on_row(0, *_waves(2.0 * math.pi * frequency * t))
        return [Family(Channel.ARM, Variable.OWN_FREQUENCY, torque=wave)]
    if effect.type.reads and not effect.type.constant:
        row = _ROWS[effect.type.reads]
        turn = on_row(row, *_waves(s.expected[:, row]))
        return [Family(Channel.SENSOR, Variable.OWN_TURN, misreading=turn)]
    return []


def _waves(angle: Array) -> list[Array]:
    return [wave(k * angle) for k in _HARMONICS for wave in (np.sin, np.cos)]
