"""One name or two: whether two effects together explain better what one was taken for.

A search that adds one effect at a time starts with whatever explains most alone. That may be one that resembles both of
two that are there: a tilted base pulls on the arm and shifts the pendulum's zero, as an offset and a wrong zero do.
Nothing is left beside it then, and no further step would ever come back to the two.
"""

from __future__ import annotations

from itertools import combinations

from .multistart import REACH, added, alike, between, race, without
from .scores import Fit
from .search import OWN_SHARE, THRESHOLD, Ranking, Search, Suspect, price, slight

_TOGETHER = 0.8  # of the one's gain, what two must have between them, and neither alone
_PAIRS = 6  # that are tried at most


def two_for_one(search: Search, ranking: Ranking, nominal: Fit) -> tuple[Ranking, ...] | None:
    """Rankings of two effects that take the place of the first of `ranking`, each beside the other, or None.

    nominal: the model without either. Two are believed if they gain as much more than the one, net of what they cost,
    as one effect must gain to be believed at all.
    """
    one = ranking[0]
    pairs = _pairs(ranking)
    if not pairs:
        return None
    search.tell(f"trying two effects in place of {one.name}")
    rest, noise = without(one.fit, nominal), between(one.fit, nominal)
    entries = {
        f"{a.name} {b.name}": (rest.with_effects(added(a.fit, nominal), added(b.fit, nominal)), noise) for a, b in pairs
    }
    fits = race(entries, nominal, search.anchor, ahead=one.fit.value)
    best = min(fits, key=lambda names: fits[names].value)
    if fits[best].value > one.fit.value + REACH:
        return None
    both = search.fitted(fits[best].plant, fits[best])
    if nominal.value - both.value - sum(price(name, nominal.samples) for name in best.split()) < one.net + THRESHOLD:
        return None
    return _each(search, both)


def _pairs(ranking: Ranking) -> list[tuple[Suspect, Suspect]]:
    """Pairs of suspects that may stand behind the first of a ranking, the most promising first."""
    whole = ranking[0].gain
    parts = [s for s in ranking[1:] if OWN_SHARE * whole < s.gain < _TOGETHER * whole]
    pairs = [(a, b) for a, b in combinations(parts, 2) if a.gain + b.gain > _TOGETHER * whole]
    pairs = [(a, b) for a, b in pairs if not alike(a.name, b.name)]
    return sorted(pairs, key=lambda pair: -(pair[0].gain + pair[1].gain))[:_PAIRS]


def _each(search: Search, both: Fit) -> tuple[Ranking, ...] | None:
    """Each of two effects against its rivals, with the other in the model; None if one of them turns out slight."""
    found: list[Ranking] = []
    current = both
    for name in [e.name for e in both.plant.effects]:
        search.tell(f"reconsidering {name}")
        reduced = search.reduced(current, name)
        names, table = search.suspects(reduced, 1)
        _, again = search.refits(reduced, names, table, held=current)
        current = again[0].fit
        found.append(again)
    if any(slight(r[0].name, r[0].gain, [other for other in found if other is not r]) for r in found):
        return None
    return tuple(found)
