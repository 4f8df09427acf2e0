"""What no descent moves, and is stepped instead: whole numbers, and sizes in which the likelihood is rough."""

from __future__ import annotations

from furuta_gym.plant import Effect, Parameter, Plant

from ...kalman.noise_model import Noise
from .multistart import added, race, with_effect, without
from .scores import Fit

_FACTORS = (1.25, 1.08)  # on a rough size: wide steps first, then narrow ones

Entries = dict[str, tuple[Plant, Noise]]


def starts_of(start: Effect, current: Fit, anchor: Plant) -> Entries:
    """Where the fits of a suspect start: at what its score suggests and, for a rough size, at every value of its grid.
    Keys begin with the effect's name."""
    entries = {start.name: with_effect(current, start, anchor)}
    usual = current.plant.default_effect(start.name).parameters
    for p in start.type.parameters:
        for value in p.grid if p.rough and not isinstance(p.grid, str) else ():
            size = value * usual[p.name] / p.default
            if size != start.parameters[p.name]:
                other = Effect(start.name, {**start.parameters, p.name: size})
                entries[f"{start.name} {p.name} = {size:g}"] = with_effect(current, other, anchor)
    return entries


def best_of(fits: dict[str, Fit]) -> dict[str, Fit]:
    """The best fit of each suspect, by its name, from fits by the keys of `starts_of`."""
    best: dict[str, Fit] = {}
    for key, fitted in fits.items():
        name = key.split()[0]
        if name not in best or fitted.value < best[name].value:
            best[name] = fitted
    return best


def stepped(found: Fit, current: Fit, anchor: Plant) -> Fit:
    """The fit with what no descent moves of the effect it adds stepped while that makes it better: whole numbers
    (periods a turn), which a score chose at another θ, by one; rough sizes by factors."""
    for p in added(found, current).type.parameters:
        if p.integer and p.role == "shape":
            found = _walked(found, current, anchor, p, (-1.0, 1.0))
        elif p.rough:
            for factor in _FACTORS:
                found = _walked(found, current, anchor, p, (1.0 / factor, factor))
    return found


def _walked(found: Fit, current: Fit, anchor: Plant, p: Parameter, moves: tuple[float, ...]) -> Fit:
    """Moves of one parameter (added to a whole number, a factor on any other), on in the same direction while the fit
    gets better."""
    while moves:
        effect, rest = added(found, current), without(found, current)
        value = effect.parameters[p.name]
        values = {move: value + move if p.integer else value * move for move in moves}
        entries = {
            f"{move:+g}": (rest.with_effects(Effect(effect.name, {**effect.parameters, p.name: x})), found.noise)
            for move, x in values.items()
            if p.lower <= x <= p.upper
        }
        fits = race(entries, current, anchor, ahead=found.value)
        best = min(fits, key=lambda key: fits[key].value, default=None)
        if best is None or fits[best].value >= found.value:
            break
        found = fits[best]
        moves = tuple(move for move in moves if f"{move:+g}" == best)
    return found
