"""The steps of a search for missing effects: who is suspected, refitted, and reconsidered when another joins.

Every suspect is fitted together with θ and the noise intensities (frozen noise hides most of the evidence, and θ fitted
without the effect carries part of it).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from furuta_gym.plant import EFFECTS, Plant

from ..prediction_error import quietest
from .candidates import Fit, Score, fit, scores
from .race import REACH, added, alike, chase, leading, race, retry, without
from .stepping import best_of, starts_of, stepped

THRESHOLD = 10.0  # nats, net of the price of the parameters: what an effect must gain to be believed
OWN_SHARE = 0.2  # of the largest gain before, what a further effect must explain
LEAST_SHARE = 0.1  # the same where it is just what was missing: structure was left without it, none is with it
_ALIKE_SHARE = 0.5  # the same of the gain of a look-alike
_SHORTLIST, _NEAR = 6, 0.15  # effects, and the share of the best score that they must have
_FAINT = (0.5, 1.5)  # of the price, what a score must reach: the first effect's, later ones'
_QUIETER = 100.0
_POWERS = {"frequencies": 1.5, "times": 1.0}
_FINALISTS = 4  # suspects that are finished at most
_CONTESTED = 0.3  # of the leader's net gain, of a suspect that may take its place when another effect has been found


@dataclass(frozen=True)
class Suspect:
    """A refitted effect. `gain` [nats]: log-likelihood over the model without it; `net`: minus its price."""

    name: str
    gain: float
    net: float
    fit: Fit = field(repr=False)
    score: float = 0.0


Ranking = tuple[Suspect, ...]


def shortlist(table: dict[str, Score], samples: int, least: float) -> list[str]:
    """Effects whose score comes near the best one's, and what the best few are mistaken for (equal to first order,
    apart in a refit), if the score is `least` times what the effect's parameters cost."""
    promising = {n: s for n, s in table.items() if s.start is not None and s.gain > least * price(n, samples)}
    ranked = sorted(promising, key=lambda name: -promising[name].gain)
    names = [n for n in ranked[:_SHORTLIST] if promising[n].gain > _NEAR * promising[ranked[0]].gain]
    for name in names[:3]:
        names += [n for n in EFFECTS[name].mistaken_for if n in promising and n not in names]
    return names


def price(name: str, samples: int) -> float:
    """What an effect's parameters cost [nats]: half ln N each (the Bayesian information criterion), but 3/2 ln N for a
    frequency and ln N for an instant, which N samples determine so well that more of them can be told apart (Djurić
    1998, "Asymptotic MAP criteria for model selection")."""
    priced = [p for p in EFFECTS[name].parameters if not p.optional]
    powers = [_POWERS.get(p.grid, 0.5) if isinstance(p.grid, str) else 0.5 for p in priced]
    return sum(powers) * math.log(samples)


def slight(name: str, gain: float, others: Sequence[Ranking], share: float = OWN_SHARE) -> bool:
    """Whether an effect may only mend the form of another: it explains far less, or, if it is a look-alike, not even
    half. No rig has an effect in the library's very words, and what the words miss of a large effect looks like a small
    one of another name, of one that is mistaken for it most of all."""
    return any(gain < (_ALIKE_SHARE if alike(name, other.name) else share) * other.gain for other, *_ in others)


@dataclass(frozen=True)
class Search:
    """What stays the same from step to step."""

    anchor: Plant
    only: Sequence[str] | None
    tell: Callable[[str], None]

    def suspects(self, current: Fit, found: int) -> tuple[list[str], dict[str, Score]]:
        """Effects worth a refit, and the scores of all. Where the noise has been fitted to hide what is missing, scores
        at less noise choose."""
        table = scores(current, self.only)
        names = shortlist(table, current.samples, _FAINT[min(found, 1)])
        hiding = np.any(current.noise[:2] > 10.0 * quietest(current.plant, current.records))
        convincing = any(table[n].gain > price(n, current.samples) + THRESHOLD for n in names)
        if hiding and not convincing:
            quiet = scores(current, self.only, quieter=_QUIETER)
            more = [n for n in shortlist(quiet, current.samples, 1.0) if n not in names]
            table |= {n: replace(quiet[n], gain=table[n].gain) for n in more}
            names += more
        if names:  # something is missing: then also what no score can suspect
            abrupt = [n for n in table if n not in names and any(p.abrupt for p in EFFECTS[n].parameters)]
            table |= {n: replace(table[n], start=current.plant.default_effect(n)) for n in abrupt}
            names += abrupt
        return names, table

    def refits(
        self,
        current: Fit,
        names: Sequence[str],
        table: dict[str, Score],
        thorough: bool = False,
        held: Fit | None = None,
        least: float = 0.0,
    ) -> tuple[Fit, Ranking]:
        """Suspects refitted; the model without any is refitted from the best one's θ, so that neither stopped early.

        held: a fit with an effect more than `current` that takes part as it is. least [nats]: gain below which the
        best stays as coarsely fitted as it is.
        """
        anchor, tell = self.anchor, self.tell
        starts = {name: start for name in names if (start := table[name].start) is not None}
        if held is not None:
            starts[added(held, current).name] = added(held, current)
        if not starts:
            return current, ()
        tell(f"racing {', '.join(starts)}")
        ahead = math.inf if held is None else held.value
        entries = {key: at for start in starts.values() for key, at in starts_of(start, current, anchor).items()}
        fits = best_of(race(entries, current, anchor, ahead))
        if held is not None and held.value < fits[added(held, current).name].value:
            fits[added(held, current).name] = held
        lost = min(f.value for f in fits.values()) > current.value + REACH  # worse than without any: all went astray
        retried: set[str] = set()
        if thorough or lost:
            retried = set(fits)
            retry(list(fits), starts, fits, current, anchor, tell)
        led: set[str] = set()
        while (leader := min(fits, key=lambda name: fits[name].value)) not in led:
            led.add(leader)
            if fits[leader] is not held and (fresh := [n for n in leading(fits) if n not in retried]):
                retried.update(fresh)
                retry(fresh, starts, fits, current, anchor, tell)
            chase(leader, fits, current, anchor, tell)
        best = min(f.value for f in fits.values())
        if current.value - best >= least:
            current = self._finish(fits, current, held)
        suspects = []
        for name, fitted in fits.items():
            gain = current.value - fitted.value
            score = table[name].gain if name in table else 0.0
            suspects.append(Suspect(name, gain, gain - price(name, fitted.samples), fitted, score))
        return current, tuple(sorted(suspects, key=lambda s: -s.net))

    def _finish(self, fits: dict[str, Fit], current: Fit, held: Fit | None) -> Fit:
        """Fits the leading suspects to the end, in place; returns the model without any, the better of two starts."""
        best = min(f.value for f in fits.values())
        hopeful = [n for n in fits if current.value - fits[n].value > price(n, current.samples) + THRESHOLD - REACH]
        for name in sorted(hopeful, key=lambda name: fits[name].value)[:_FINALISTS]:
            if fits[name].value < best + REACH and fits[name] is not held:
                self.tell(f"finishing {name}")
                nearest = stepped(fits[name], current, self.anchor)
                fits[name] = self.fitted(nearest.plant, nearest)
        self.tell("refitting the model without it")
        plant = without(min(fits.values(), key=lambda f: f.value), current)
        again = self.fitted(plant, current)
        return again if again.value < current.value else current

    def fitted(self, plant: Plant, start: Fit) -> Fit:
        """A plant refitted to the end, from the noise of another fit."""
        return fit(plant, start.noise, start.records, anchor=self.anchor)

    def reduced(self, fitted: Fit, name: str) -> Fit:
        """Refitted without one of its effects."""
        plant = fitted.plant.replace(effects=tuple(e for e in fitted.plant.effects if e.name != name))
        return self.fitted(plant, fitted)

    def reconsidered(self, found: list[Ranking]) -> list[Ranking]:
        """The rankings of the effects found, in the light of the last: a look-alike may have taken the place of one
        while the other was missing. Effects that have become superfluous or slight go, others may be exchanged."""
        current, changed = found[-1][0].fit, False
        for ranking in found[:-1]:
            name = ranking[0].name
            self.tell(f"reconsidering {name}")
            reduced = self.reduced(current, name)
            others = [r for r in found if r is not ranking]
            nearest = stepped(current, reduced, self.anchor)
            if nearest is not current:
                current, changed = self.fitted(nearest.plant, nearest), True
            gain = reduced.value - current.value
            if gain - price(name, current.samples) < THRESHOLD or slight(name, gain, others):
                found, current, changed = others, reduced, True
            elif any(s.net > _CONTESTED * ranking[0].net for s in ranking[1:]):
                names, table = self.suspects(reduced, len(others))
                _, again = self.refits(reduced, names, table, held=current)
                changed = changed or again[0].name != name
                current = again[0].fit
                found = [again if r is ranking else r for r in found]
        if changed:
            name = found[-1][0].name
            gain = self.reduced(current, name).value - current.value
            last = replace(found[-1][0], gain=gain, net=gain - price(name, current.samples))
            found[-1] = (last, *found[-1][1:])
        found[-1] = (replace(found[-1][0], fit=current), *found[-1][1:])
        return found
