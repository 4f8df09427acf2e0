"""The race of suspects: coarse refits, a few iterations at a time, from starts that are likely to lead on.

A refit descends from the θ of the model without the effect, which the missing effect has dragged away; some suspects
get stuck there. So the leader runs again from other sizes, and the others from the leader's θ, until nobody overtakes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from furuta_gym.plant import EFFECTS, Effect, Plant

from ...estimation.pool import shared_pool
from ...kalman.noise_model import Noise
from .scores import Fit, fit

REACH = 25.0  # nats: suspects so near to the best are worth finishing
_HEAT, _ROUNDS = 4, 8  # iterations in a round of the race, and rounds at most
_CATCHES_UP = 3.0  # rounds at its last pace within which a suspect must reach the best to go on
_CHASERS = 2  # of those that are no look-alikes
_RESTART = 10.0  # factor on the noise
_DRAGGED = 0.3  # log of a factor
_LARGER, _SMALLER = 3.0, 0.6  # times the size that the score suggests; times that of effects found before


def race(
    entries: dict[str, tuple[Plant, Noise]],
    current: Fit,
    anchor: Plant,
    ahead: float = math.inf,
    halve: bool | None = None,
) -> dict[str, Fit]:
    """Coarse fits from plants and noise, a few iterations at a time; who cannot catch up any more stops.

    ahead: value of a fit that runs before them. halve: halve the field after each round (default: without `ahead`).
    """
    halve = math.isinf(ahead) if halve is None else halve
    fits: dict[str, Fit] = {}
    for turn in range(_ROUNDS):
        if not entries:
            break
        results = shared_pool().map(lambda entry: _round(current, entry, anchor), entries.values())
        pace = {}
        for name, result in zip(list(entries), results, strict=True):
            pace[name] = fits[name].value - result.value if name in fits else math.inf
            fits[name] = result
        best = min(ahead, *(f.value for f in fits.values()))
        on = [name for name in sorted(entries, key=lambda name: fits[name].value) if not fits[name].optimum.converged]
        if halve:
            on = on[: max(2, len(fits) >> (turn + 1))]
        entries = {
            name: (fits[name].plant, fits[name].noise)
            for name in on
            if fits[name].value - _CATCHES_UP * pace[name] < best + REACH
        }
    return fits


def _round(current: Fit, entry: tuple[Plant, Noise], anchor: Plant) -> Fit:
    plant, noise = entry
    return fit(plant, noise, current.records, anchor=anchor, iterations=_HEAT, coarse=True)


def retry(names: Sequence[str], starts: dict[str, Effect], fits: dict[str, Fit], current: Fit, anchor: Plant, tell):
    """Race on from other sizes of some suspects' effects. A score is taken where θ and the noise have swallowed most of
    an effect: it suggests too small a size, at times of the wrong sign, and from there the descent may not find the
    way. Keeps in `fits` what is better."""
    entries: dict[str, tuple[Plant, Noise]] = {}
    for name in names:
        larger, mirrored = resized(starts[name], _LARGER), resized(starts[name], -1.0)
        if larger is not None:
            entries[f"{name} larger"] = with_effect(current, larger, anchor)
            entries[f"{name} afresh"] = _afresh(current, larger, anchor)
            if current.plant.effects:  # what was found before has taken this one's part as well
                smaller = [resized(e, _SMALLER) or e for e in current.plant.effects]
                plant, noise = entries[f"{name} afresh"]
                entries[f"{name} shared"] = plant.with_effects(*smaller), noise
        if mirrored is not None:
            entries[f"{name} mirrored"] = with_effect(current, mirrored, anchor)
    tell(f"trying other sizes of {', '.join(names)}")
    for entry, again in race(entries, current, anchor, min(f.value for f in fits.values()), halve=True).items():
        name = entry.split()[0]
        if again.value < fits[name].value:
            fits[name] = again


def resized(effect: Effect, factor: float) -> Effect | None:
    """The effect with `factor` times its size, None where its bounds forbid that or no size can be scaled."""
    values = dict(effect.parameters)
    for p in effect.type.parameters:
        if p.role == "size" and not p.integer:
            # where no effect is an infinite value (a stiffness, a limit), a smaller value is more of it
            values[p.name] = values[p.name] * factor if math.isfinite(p.neutral) else values[p.name] / factor
            if not p.lower <= values[p.name] <= p.upper:
                return None
    return Effect(effect.name, values) if values != dict(effect.parameters) else None


def chase(leader: str, fits: dict[str, Fit], current: Fit, anchor: Plant, tell) -> None:
    """Race on from the leader's θ, which is near the truth if its name is nearly right: there the others soon find
    their best. Keeps in `fits` what is better; one of them may lead then, and the leader be among those that follow."""
    rivals = {
        name: (
            without(fits[leader], current).with_effects(added(fits[name], current)),
            between(fits[leader], current),
        )
        for name in _rivals(leader, fits)
        if name != leader
    }
    tell(f"chasing {leader} with {', '.join(rivals) or 'none'}")
    for name, chaser in race(rivals, current, anchor, ahead=fits[leader].value).items():
        if chaser.value < fits[name].value:
            fits[name] = chaser


def leading(fits: dict[str, Fit]) -> list[str]:
    """The leader of a race and its best look-alike."""
    leader = min(fits, key=lambda name: fits[name].value)
    return [leader, *_alike(leader, fits)[:1]]


def _rivals(leader: str, fits: dict[str, Fit]) -> list[str]:
    """What might be mistaken for the leader: its look-alikes, and the next in the race."""
    same = _alike(leader, fits)
    return [*same, *[n for n in sorted(fits, key=lambda n: fits[n].value) if n not in same][: 1 + _CHASERS]]


def _alike(leader: str, fits: dict[str, Fit]) -> list[str]:
    """Its look-alikes, the best first."""
    return sorted((name for name in fits if alike(name, leader)), key=lambda name: fits[name].value)


def alike(one: str, other: str) -> bool:
    """Whether one of two effects is declared to be mistaken for the other."""
    return one in EFFECTS[other].mistaken_for or other in EFFECTS[one].mistaken_for


def between(leader: Fit, current: Fit) -> Noise:
    """Noise for a rival at the leader's θ: half way, in the logarithm, back to what the model without it needs."""
    own, other = leader.noise.packed(), current.noise.packed()
    return Noise.unpacked(np.sqrt(own * np.maximum(other, own)))


def with_effect(current: Fit, start: Effect, anchor: Plant) -> tuple[Plant, Noise]:
    """Plant and noise to start from, with an effect added. Where the first missing effect has dragged the scale of the
    pendulum's row away, the way back leads along a narrow valley: starting at the anchor's θ is shorter. Once an effect
    has been found, the anchor, which has none, is the one that is far away."""
    dragged = np.abs(np.log(np.maximum(current.plant.theta[2:5], 1e-12) / anchor.theta[2:5])).max()
    if dragged > _DRAGGED and not current.plant.effects:
        return _afresh(current, start, anchor)
    return current.plant.with_effects(start), current.noise


def _afresh(current: Fit, start: Effect, anchor: Plant) -> tuple[Plant, Noise]:
    """From the anchor's θ, with noise enough to find the way."""
    plant = current.plant.replace(theta=anchor.theta).with_effects(start)
    return plant, current.noise.louder(_RESTART)


def added(fitted: Fit, current: Fit) -> Effect:
    """The effect of `fitted` that `current` does not have (a plant keeps its effects in the library's order)."""
    had = {e.name for e in current.plant.effects}
    return next(e for e in fitted.plant.effects if e.name not in had)


def without(fitted: Fit, current: Fit) -> Plant:
    """The plant of `fitted` with only the effects of `current`."""
    keep = {e.name for e in current.plant.effects}
    return fitted.plant.replace(effects=tuple(e for e in fitted.plant.effects if e.name in keep))
