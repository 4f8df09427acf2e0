"""Wider laws of the effects found: what is left may be what the plain law of one of them misses.

A second name beside a first is easily found where the first one's law is too narrow. So a wider law of the same cause
is fitted before another effect is looked for.
"""

from __future__ import annotations

import math

from furuta_gym.plant import Effect

from .fits import Fit
from .search import Search


def widened(current: Fit, search: Search) -> Fit:
    """The fit with wider laws of its effects, where the logs pay for their parameters; else the fit itself."""
    best = current
    for effect in current.plant.effects:
        starts = effect.type.wider(effect.parameters) if effect.type.wider else ()
        if not starts:
            continue
        search.progress(f"fitting a wider law of {effect.name}")
        fits = [search.fitted(best.plant.with_effects(Effect(effect.name, values)), best, "full") for values in starts]
        wider = min(fits, key=lambda fitted: fitted.value)
        price = 0.5 * sum(bool(p.optional) for p in effect.type.parameters) * math.log(wider.samples)
        if best.value - wider.value - price > search.policy.believed:
            best = wider
    return best
