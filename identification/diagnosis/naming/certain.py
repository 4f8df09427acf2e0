"""Whether the size of an effect found is certain. Error bars allow for what the model lacks, and the likelihood that
names an effect does not: a small effect beside others may be likely by many nats, and as well be absent."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.stats import chi2

from furuta_gym.plant import Plant

from ...estimation.pool import mapped, shared_pool
from .found import FoundEffect, Naming
from .judge import Witness
from .search import Search
from .upheld import without_name


def may_be_absent(plant: Plant, name: str, level: float) -> bool:
    """Whether all sizes of an effect together lie within the region of a `level` around doing nothing (Wald's test,
    with the plant's covariance). They are judged together, as one may imitate another: of a cable, the stiffness and
    its rise.

    False where a size has no error bar, or its logarithm is what was estimated.
    """
    effect, known = plant.effect(name), plant.covariance
    if effect is None or known is None:
        return False
    neutral = effect.type.neutral()
    in_play = [p for p in effect.type.in_play(effect.parameters) if p.role == "size"]
    sizes = [p for p in in_play if effect.parameters[p.name] != neutral[p.name] or p.name in effect.std]
    called = [f"{name}.{p.name}" for p in sizes]
    if not sizes or any(p.logarithmic or p.name not in effect.std for p in sizes) or not {*called} <= {*known.names}:
        return False
    at = [known.names.index(one) for one in called]
    away = np.array([effect.parameters[p.name] - neutral[p.name] for p in sizes])
    spread = known.matrix[np.ix_(at, at)]
    scale = np.sqrt(np.maximum(np.diag(spread), 1e-300))
    distance = (away / scale) @ np.linalg.pinv(spread / np.outer(scale, scale), hermitian=True) @ (away / scale)
    return bool(distance < chi2.ppf(level, len(sizes)))


def perhaps_absent(naming: Naming, plant: Plant, level: float) -> list[FoundEffect]:
    """The effects that may be absent as far as `plant`, the estimate with all of them, says. Of one name alone, or of
    one whose law another effect describes, that is not asked."""
    described = {naming.describes(name) for name in naming.names}
    if len(naming.own) < 2:
        return []
    return [e for e in naming.own if e.name not in described and may_be_absent(plant, e.name, level)]


def without_absent(
    naming: Naming, plant: Plant, search: Search, witness: Witness, needed: Collection[str]
) -> Naming | None:
    """The names without one that may be absent and that data which no fit saw do not ask for: of several the one that
    is missed least. None if there is no such name. needed: names that are not asked about."""
    doubtful = [e for e in perhaps_absent(naming, plant, search.policy.present) if e.name not in needed]
    if not doubtful:
        return None
    names = [effect.name for effect in doubtful]
    search.progress(f"asking held-out data about {', '.join(names)}, whose size may be zero")
    fits = list(mapped(shared_pool(), partial(search.reduced, naming.final), names))
    witness.hears([naming.final, *fits])
    for effect, reduced in sorted(zip(doubtful, fits, strict=True), key=lambda pair: pair[1].value):
        if not witness.confirms(reduced, naming.final):
            fewer = without_name(naming, effect, search.to_the_end(reduced))
            return replace(fewer, perhaps_absent=(*naming.perhaps_absent, effect.suspect))
    return None
