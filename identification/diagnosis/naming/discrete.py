"""Parameters that no descent moves, and that are stepped instead: whole numbers, and sizes in which the likelihood is
rough."""

from __future__ import annotations

from furuta_gym.plant import Effect, Parameter, Plant

from .fits import Fit, added, without_further
from .multistart import EffectStart, Setting, multi_start, with_effect

_FACTORS = (1.25, 1.08)  # on a rough size: wide steps first, then narrow ones


def grid_of(effect: Effect, plant: Plant) -> list[Effect]:
    """The effect and, for a rough size, the effect at every other value of its grid."""
    effects = [effect]
    usual = plant.default_effect(effect.name).parameters
    for p in effect.type.parameters:
        for size in p.grid_on(usual[p.name]) if p.rough else ():
            if size != effect.parameters[p.name]:
                effects.append(Effect(effect.name, {**effect.parameters, p.name: size}))
    return effects


def starts_of(start: Effect, current: Fit, setting: Setting) -> list[EffectStart]:
    """Where the fits of an effect start: at what its score suggests and, for a rough size, at every value of its
    grid."""
    return [with_effect(current, effect, setting) for effect in grid_of(start, current.plant)]


def stepped(found: Fit, current: Fit, setting: Setting, rough: bool = True) -> Fit:
    """The fit, better where steps in such parameters of the effect that it adds improve it: whole numbers (periods a
    turn), which a score chose at another θ, by one; rough sizes, if asked for, by factors."""
    for p in added(found, current).type.parameters:
        if p.integer and p.role == "shape":
            found = _walked(found, current, setting, p, (-1.0, 1.0))
        elif p.rough and rough:
            for factor in _FACTORS:
                found = _walked(found, current, setting, p, (1.0 / factor, factor))
    return found


def _walked(found: Fit, current: Fit, setting: Setting, p: Parameter, moves: tuple[float, ...]) -> Fit:
    """Moves of one parameter (added to a whole number, a factor on any other), on in the same direction while the fit
    gets better."""
    while moves:
        effect, plant = added(found, current), without_further(found, current)
        value = effect.parameters[p.name]
        starts = {}
        for move in moves:
            x = value + move if p.integer else value * move
            if p.lower <= x <= p.upper:
                moved = plant.with_effects(Effect(effect.name, {**effect.parameters, p.name: x}))
                starts[EffectStart((effect.name,), moved, found.noise, found.zeros)] = move
        fits = multi_start(list(starts), current, setting, ahead=found.value)
        best = min(fits, key=lambda start: fits[start].value, default=None)
        if best is None or fits[best].value >= found.value:
            break
        found, moves = fits[best], (starts[best],)
    return found
