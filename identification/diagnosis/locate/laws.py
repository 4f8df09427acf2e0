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

from furuta_gym.plant import EFFECTS, THETA_NAMES, Effect, Plant

from ...discrepancy.basis import ZEROS, Family, Signals, on_row, stages
from ...friction_memory import bristle

Array = NDArray[np.float64]

Variable = tuple[str, str]
"""Channel and variable, as of a `Family`."""

_SPEEDS = frozenset({("arm", "arm speed"), ("pendulum", "pendulum speed")})
_JOINTS = {"1": "arm", "2": "pendulum"}
_ROWS = {"arm": 0, "pendulum": 1}
_TRAVELS = (0.3, 1.0, 3.0)  # times an effect's own, of bristles
_HARMONICS = (1, 2, 3)
_BY_ANGLE, _SMOOTH = ("arm", "arm angle"), "smooth in the arm angle"
_DEGREE = 6  # of polynomials in an angle


def own_variables(name: str) -> frozenset[Variable]:
    """What another law of an effect would go with, in the words of the families of `locate`."""
    effect = EFFECTS[name]
    found: set[Variable] = set()
    for hook, arguments in effect.arguments.items():
        if hook in ("delay", "filter"):
            found.add(("input", "change of the command"))
        elif hook == "command":
            found |= {("input", "command"), ("arm", "constant")}
        elif hook == "sensor":
            found |= {("sensor", f"{effect.reads} angle")} | {
                ("sensor", zero) for zero, of in ZEROS.items() if of.startswith(effect.reads)
            }
        elif hook == "theta":
            found |= _SPEEDS if {"r1", "r2"} & set(effect.changes) else set()
            found |= {("pendulum", "time (masses)")} if "t" in arguments else set()
        elif hook == "torque":
            found |= _of_torque(effect.place, set(arguments), bool(effect.memory))
    return frozenset(found)


def _of_torque(place: str, arguments: set[str], remembers: bool) -> set[Variable]:
    moving = {a for a in arguments if a[0] == "v"}
    if place == "arm and pendulum":
        if moving:  # air drag
            return {(joint, f"{_JOINTS[a[1]]} speed") for joint in _ROWS for a in moving}
        return {("pendulum", v) for v in ("constant", "arm angle", "pendulum angle")}  # a tilt: what no cable has
    if remembers:
        return {(place, "memory of the motion"), (place, f"{place} speed")}
    if {"t", "tau"} <= arguments:
        return {(place, "time (gain)")}
    if "t" in arguments:
        return {(place, "time (friction)" if moving else "frequency")}
    if moving and "q1" in arguments:
        return {(place, "arm angle and direction")}
    return {
        (place, f"{_JOINTS[a[1]]} {kind}")
        for a in arguments
        for letter, kind in (("q", "angle"), ("v", "speed"))
        if a in (f"{letter}1", f"{letter}2")
    }


def ways(name: str, own: Iterable[Family]) -> list[frozenset[Variable]]:
    """Sets of variables, any of which another law of an effect may go with. own: its `own_families`.

    Piecewise linear functions of an angle cost more than a polynomial where the law is smooth, and their corners show
    where a fit is near; a polynomial has no corner where the law has one.
    """
    known, found = own_variables(name), {(family.channel, family.variable) for family in own}
    smooth = {variable for variable in found if variable[1] == _SMOOTH}
    first = known | (found - smooth)
    return [frozenset(first), frozenset((first - {_BY_ANGLE}) | smooth)] if smooth else [frozenset(first)]


def own_families(name: str, plant: Plant, signals: Signals, span: tuple[float, float]) -> list[Family]:
    """Families beyond those that `locate` knows, for another law of an effect: near standstill where it goes with a
    speed, over time where it is an offset, and at the scale of its parameters where the plant has it.

    span [s]: of the log's clock.
    """
    found = []
    for channel, variable in sorted(own_variables(name)):
        if variable == f"{channel} speed":
            row = _ROWS[channel]
            found.append(
                Family(channel, "near standstill", on_row(row, *_near(signals.v[:, row], plant.sharpness[row])))
            )
        if (channel, variable) == _BY_ANGLE:
            found.append(Family("arm", _SMOOTH, on_row(0, *_polynomials(signals.q[:, 0]))))
    if EFFECTS[name].constant and not EFFECTS[name].reads:
        found.append(Family("arm", "time", on_row(0, *stages(signals.t, span))))
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
        return [Family("arm", "memory at its own travel", on_row(0, *columns))]
    if periods := effect.type.periods_a_turn:
        return [Family("arm", "its own ripple", on_row(0, *_waves(p[periods] * q1)))]
    if effect.type.dry and effect.type.of_arm_angle:
        turning = np.tanh(plant.sharpness[0] * v1)
        return [Family("arm", "its own friction", on_row(0, *(w * turning for w in _waves(q1))))]
    if frequency := next((p[known.name] for known in effect.type.parameters if known.repeats), None):
        return [Family("arm", "its own frequency", on_row(0, *_waves(2.0 * math.pi * frequency * t)))]
    if effect.type.reads and not effect.type.constant:
        row = _ROWS[effect.type.reads]
        return [Family("sensor", "its own turn", None, on_row(row, *_waves(s.expected[:, row])))]
    return []


def _waves(angle: Array) -> list[Array]:
    return [wave(k * angle) for k in _HARMONICS for wave in (np.sin, np.cos)]
