"""Every effect fitted from the logs' own starts: what finds a name where model (5) alone leads far away from the rig.

Scores and fits of a search start at the model without the effect. A strong effect drags that model's θ so far that its
own score is small there, and that no descent comes back. Start values from smoothed derivatives know nothing of that
model; on thinned records a fit of every effect from there takes tenths of a second.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from furuta_gym.plant import EFFECTS

from ...estimation.pool import mapped, shared_pool
from ...estimation.start import Start, reduced
from .discrete import grid_of
from .fits import Fit, added
from .multistart import EffectStart, best_of, catches_up, multi_start, one_round
from .search import Search
from .suspects import price_in


def afresh(
    nominal: Fit,
    starts: Sequence[Start],
    search: Search,
    known: Fit | None,
    remembering: Sequence[Start],
) -> dict[str, Fit]:
    """The best fits of model (5) with one effect among those that start at `starts`, by the effect's name.

    nominal: the model without effects, which gives the records. starts: from `estimation.start.candidates`; without
    any, nothing is found. remembering: starts with friction that remembers, one effect each. known: a fit that is
    there already; what cannot catch up with it is not followed.
    """
    names = [n for n in search.only or EFFECTS if n in EFFECTS]
    policy, records = search.policy, nominal.records
    share = min(1.0, policy.thinned_length / sum(r.duration for r in records))
    thin = replace(nominal, records=tuple(reduced(r, share * r.duration, policy.thinned, clock=True) for r in records))
    plants = [replace(nominal.plant, theta=start.plant.theta) for start in starts[: policy.log_starts]]
    noises = [start.noise for start in starts[: policy.log_starts]]
    effects = [e for n in names for e in grid_of(nominal.plant.default_effect(n), nominal.plant)]
    both = list(zip(plants, noises, strict=True))
    tried = {e: [EffectStart((e.name,), p.with_effects(e), v) for p, v in both] for e in effects}
    for start in remembering:
        (effect,) = start.plant.effects
        if effect.name in names:
            plant = replace(nominal.plant, theta=start.plant.theta, effects=(effect,))
            tried.setdefault(effect, []).append(EffectStart((effect.name,), plant, start.noise))
    if not (plants and effects):
        return {}
    every = [start for group in tried.values() for start in group]
    rounds = mapped(shared_pool(), lambda start: one_round(start, thin, search), every)
    first = dict(zip(every, rounds, strict=True))
    best = {_start_at(found := min((first[s] for s in group), key=_value), nominal): found for group in tried.values()}
    ahead = math.inf if known is None else one_round(known, thin, search).value
    least = min(ahead, *map(_value, best.values()))
    on = [start for start, fitted in best.items() if catches_up(fitted, fitted.promised, least, policy)]
    ends = best_of(multi_start(on, thin, search, ahead, halve=False), best_of(best))
    order = sorted(ends, key=lambda name: cost(ends[name]))
    full = [_start_at(ends[name], nominal) for name in order[: policy.fitted_whole]]
    return best_of(multi_start(full, nominal, search, halve=False))


def _value(fitted: Fit) -> float:
    return fitted.value


def _start_at(fitted: Fit, nominal: Fit) -> EffectStart:
    return EffectStart((added(fitted, nominal).name,), fitted.plant, fitted.noise, fitted.zeros)


def cost(fitted: Fit) -> float:
    """V of a fit and the price of its effects [nats]: the smaller, the better the names explain the logs."""
    return fitted.value + sum(price_in(fitted, e.name) for e in fitted.plant.effects)
