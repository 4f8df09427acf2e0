"""Wider laws of the effects found: what is left may be what the plain law of one of them misses.

A second name beside a first is easily found where the first one's law is too narrow. So a wider law of the same cause
is fitted before another effect is looked for.
"""

from __future__ import annotations

import math

import numpy as np

from furuta_gym.plant import Effect

from .fits import Fit
from .multistart import EffectStart, multi_start, one_round
from .search import Search


def widened(current: Fit, search: Search) -> Fit:
    """The fit with wider laws of its effects, where the logs pay for their parameters; else the fit itself."""
    best = current
    for effect in current.plant.effects:
        while (wider := _wider(effect.name, best, search)) is not None:
            best = wider
    return best


def _wider(name: str, current: Fit, search: Search) -> Fit | None:
    """The best fit with a wider law of one effect; None if there is none that pays for its parameters. Coarse fits
    decide which laws are fitted to the end."""
    effect = current.plant.effect(name)
    assert effect is not None
    laws = list(effect.type.wider(effect.parameters)) if effect.type.wider else []
    if not laws:
        return None
    search.progress(f"fitting wider laws of {name}")
    starts = {_start(Effect(name, values), current): values for values in laws}
    coarse = multi_start(list(starts), current, search, ahead=current.value)
    plain = one_round(current, current, search).value  # as coarse as the others
    best, most = None, search.policy.believed
    for start, near in sorted(coarse.items(), key=lambda item: item[1].value):
        more = len(effect.type.in_play(starts[start])) - len(effect.type.in_play(effect.parameters))
        price = 0.5 * more * math.log(current.samples)
        if plain - near.value - price <= most - search.policy.equal:
            continue
        fitted = search.fitted(near.plant, near, "full")
        net = current.value - fitted.value - price
        if net > most and not _too_far(name, fitted):
            best, most = fitted, net
    return best


def _start(effect: Effect, current: Fit) -> EffectStart:
    return EffectStart((effect.name,), current.plant.with_effects(effect), current.noise, current.zeros)


def _too_far(name: str, fitted: Fit) -> bool:
    """Whether a wider law has become another effect's: a stop that slips later than the arm turns is a spring."""
    effect = fitted.plant.effect(name)
    assert effect is not None
    furthest = max(float(np.ptp(record.y[:, 0])) for record in fitted.records)
    in_play = effect.type.in_play(effect.parameters)
    return any(p.travel and effect.parameters[p.name] > furthest for p in in_play)
