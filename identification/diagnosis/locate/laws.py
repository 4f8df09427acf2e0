"""Whether the law of an effect is another than the library's: whether what a fit leaves goes with the effect's own
variables.

No rig has an effect in the library's very words. What the words miss of it goes with the same things as the effect
itself: a cable's stiffness with the arm's angle, a late command with the command's changes.
"""

from __future__ import annotations

from furuta_gym.plant import EFFECTS

Variable = tuple[str, str]
"""Channel and variable, as of a `Family`."""

_SPEEDS = frozenset({("arm", "arm speed"), ("pendulum", "pendulum speed")})
_JOINTS = {"1": "arm", "2": "pendulum"}


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
            found.add(("sensor", f"{name.split('_')[0]} angle"))
        elif hook == "theta":
            found |= _SPEEDS if {"r1", "r2"} & set(effect.changes) else set()
            found |= {("pendulum", "time (masses)")} if "t" in arguments else set()
        elif hook == "torque":
            found |= _of_torque(effect.place, set(arguments), bool(effect.memory))
    return frozenset(found)


def _of_torque(place: str, arguments: set[str], remembers: bool) -> set[Variable]:
    if place == "arm and pendulum":  # a tilt: the part that no spring or cable has
        return {("pendulum", v) for v in ("constant", "arm angle", "pendulum angle")}
    if remembers:
        return {(place, "memory of the motion"), (place, f"{place} speed")}
    moving = {a for a in arguments if a[0] == "v"}
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
