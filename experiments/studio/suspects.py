"""Who is still suspected while a search runs. No page in here."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from furuta_gym.plant import Plant
from identification.diagnosis.policy import DecisionPolicy
from identification.diagnosis.watched import Tried


@dataclass(frozen=True)
class Suspect:
    """An effect in a search that runs. gain [nats]: of the best fit with it over the model without effects, None
    before the first; behind: that fit's distance to the best of all. beside: the other effects in it. out: too far
    behind for the search to go on with it. tried_now: whether the present step fits it."""

    name: str
    gain: float | None
    behind: float
    beside: tuple[str, ...]
    out: bool
    tried_now: bool


def suspects(tried: Sequence[Tried], now: Iterable[str] = (), policy: DecisionPolicy | None = None) -> list[Suspect]:
    """The effects tried so far, the best first. now: names that the present step fits."""
    reach, now = (policy or DecisionPolicy()).reach, list(now)
    plain = max((t.log_likelihood for t in tried if not t.effects), default=None)
    best = max((t.log_likelihood for t in tried), default=0.0)
    with_it: dict[str, Tried] = {}
    for t in tried:
        for name in t.effects:
            if name not in with_it or t.log_likelihood > with_it[name].log_likelihood:
                with_it[name] = t
    found = []
    for name, t in with_it.items():
        behind = best - t.log_likelihood
        gain = None if plain is None else t.log_likelihood - plain
        beside = tuple(other for other in t.effects if other != name)
        found.append(Suspect(name, gain, behind, beside, behind > reach, name in now))
    found.sort(key=lambda suspect: suspect.behind)
    fresh = [Suspect(name, None, 0.0, (), False, True) for name in dict.fromkeys(now) if name not in with_it]
    return [*found, *fresh]


def best_plant(tried: Sequence[Tried]) -> Plant | None:
    """The plant of the best fit so far that has an effect."""
    with_effects = [t for t in tried if t.effects]
    return max(with_effects, key=lambda t: t.log_likelihood).plant if with_effects else None
