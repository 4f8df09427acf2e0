"""One name or two: whether two effects together explain better what one was taken for.

A search that adds one effect at a time starts with whatever explains most alone. That may be one that resembles both of
two that are there: a tilted base pulls on the arm and shifts the pendulum's zero, as an offset and a wrong zero do.
Nothing is left beside it then, and no further step would ever come back to the two.
"""

from __future__ import annotations

from itertools import combinations

from ..policy import DecisionPolicy
from .fits import Fit, added, without_further
from .multistart import EffectStart, between, multi_start
from .search import Search
from .suspects import Ranking, Suspect, alike, price_in, slight_beside


def two_for_one(search: Search, ranking: Ranking, nominal: Fit) -> tuple[Ranking, ...] | None:
    """Rankings of two effects that take the place of the first of `ranking`, each beside the other, or None.

    nominal: the model without either. Two are believed if they gain as much more than the one, net of what they cost,
    as one effect must gain to be believed at all.
    """
    one, policy = ranking[0], search.policy
    pairs = _pairs(ranking, policy)
    if not pairs:
        return None
    search.progress(f"trying two effects in place of {one.name}")
    plant, noise = without_further(one.fit, nominal), between(one.fit, nominal)
    starts = []
    for a, b in pairs:
        with_both = plant.with_effects(added(a.fit, nominal), added(b.fit, nominal))
        starts.append(EffectStart((a.name, b.name), with_both, noise, one.fit.zeros))
    fits = multi_start(starts, nominal, search, ahead=one.fit.value)
    best = min(fits, key=lambda start: fits[start].value)
    if fits[best].value > one.fit.value + policy.reach:
        return None
    both = search.fitted(fits[best].plant, fits[best])
    cost = sum(price_in(both, name) for name in best.effects)
    net = nominal.value - one.fit.value - price_in(one.fit, one.name)  # with a wider law, if it has one
    if nominal.value - both.value - cost < net + policy.believed:
        return None
    return _each(search, both)


def _pairs(ranking: Ranking, policy: DecisionPolicy) -> list[tuple[Suspect, Suspect]]:
    """Pairs of suspects that may stand behind the first of a ranking, the most promising first."""
    whole = ranking[0].gain
    parts = [s for s in ranking[1:] if policy.own_share * whole < s.gain < policy.together * whole]
    pairs = [(a, b) for a, b in combinations(parts, 2) if a.gain + b.gain > policy.together * whole]
    pairs = [(a, b) for a, b in pairs if not alike(a.name, b.name)]
    return sorted(pairs, key=lambda pair: -(pair[0].gain + pair[1].gain))[: policy.pairs]


def _each(search: Search, both: Fit) -> tuple[Ranking, ...] | None:
    """Each of two effects against its rivals, with the other in the model; None if one of them turns out slight."""
    found: list[Ranking] = []
    current = both
    for name in [e.name for e in both.plant.effects]:
        search.progress(f"reconsidering {name}")
        reduced = search.reduced(current, name)
        names, table = search.suspects(reduced, 1)
        _, again = search.refits(reduced, names, table, held=current)
        current = again[0].fit
        found.append(again)
    policy = search.policy
    if any(slight_beside(r[0].name, r[0].gain, [other for other in found if other is not r], policy) for r in found):
        return None
    return tuple(found)
