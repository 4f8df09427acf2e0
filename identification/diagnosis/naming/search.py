"""The steps of forward selection: which effects are suspected, how they are fitted, and which are fitted again when
another joins.

Every suspect is fitted together with θ and the noise intensities (frozen noise hides most of the evidence, and θ fitted
without the effect carries part of it).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from furuta_gym.plant import EFFECTS, Plant

from ...estimation.prediction_error import quietest
from ..policy import DecisionPolicy
from .discrete import starts_of, stepped
from .fits import Fit, Fitter, added, fit, without
from .multistart import best_and_look_alike, best_of, from_best, from_other_sizes, multi_start, rivals_of
from .scores import Score, scores
from .suspects import Ranking, Suspect, price, shortlist, slight

Scorer = Callable[..., dict[str, Score]]


def _silent(text: str) -> None:
    """Progress that nobody wants."""


@dataclass(frozen=True)
class Search:
    """What stays the same from step to step.

    anchor: plant of the weak prior. only: names of effects to consider (None: all). progress(text) is called at each
    step. fitter, scorer: what fits and scores; tests put stand-ins there.
    """

    anchor: Plant
    only: Sequence[str] | None = None
    policy: DecisionPolicy = field(default_factory=DecisionPolicy)
    progress: Callable[[str], None] = _silent
    fitter: Fitter = fit
    scorer: Scorer = scores

    def suspects(self, current: Fit, found: int) -> tuple[list[str], dict[str, Score]]:
        """Effects worth a fit, and the scores of all. Where the noise has been fitted to hide what is missing, scores
        at less noise choose. found: number of effects in the model."""
        policy = self.policy
        table = self.scorer(current, self.only, policy=policy)
        faint = policy.faint_later if found else policy.faint_first
        names = shortlist(table, current.samples, faint, policy)
        hiding = np.any(current.noise.torque > policy.hiding_noise * quietest(current.plant, current.records))
        convincing = any(table[n].gain > price(n, current.samples) + policy.believed for n in names)
        if hiding and not convincing:
            quiet = self.scorer(current, self.only, quieter=policy.quieter, policy=policy)
            more = [n for n in shortlist(quiet, current.samples, policy.faint_quiet, policy) if n not in names]
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
        """Suspects fitted; the model without any is fitted again from the best one's θ, so that neither stopped early.

        held: a fit with an effect more than `current` that takes part as it is. least [nats]: gain below which the
        best stays as coarsely fitted as it is.
        """
        suggested = {name: start for name in names if (start := table[name].start) is not None}
        if held is not None:
            suggested[added(held, current).name] = added(held, current)
        if not suggested:
            return current, ()
        fits = self._coarse(current, suggested, held, thorough)
        best = min(f.value for f in fits.values())
        if current.value - best >= least:
            fits, current = self._finished(fits, current, held)
        suspects = []
        for name, fitted in fits.items():
            gain = current.value - fitted.value
            score = table[name].gain if name in table else 0.0
            suspects.append(Suspect(name, gain, gain - price(name, fitted.samples), fitted, score))
        return current, tuple(sorted(suspects, key=lambda s: -s.net))

    def _coarse(self, current: Fit, suggested: dict, held: Fit | None, thorough: bool) -> dict[str, Fit]:
        """The best coarse fit of every suspect: from what the scores suggest, the best ones from other sizes, the
        others from the best one's θ, until the best stays the best."""
        self.progress(f"fitting {', '.join(suggested)}")
        ahead = math.inf if held is None else held.value
        starts = [at for start in suggested.values() for at in starts_of(start, current, self)]
        fits = best_of(multi_start(starts, current, self, ahead))
        if held is not None and held.value < fits[added(held, current).name].value:
            fits[added(held, current).name] = held
        tried: set[str] = set()
        # worse than without any: all went astray
        if thorough or min(f.value for f in fits.values()) > current.value + self.policy.reach:
            tried = set(fits)
            fits = self._resized(list(fits), suggested, fits, current)
        seen: set[str] = set()
        while (best := min(fits, key=lambda name: fits[name].value)) not in seen:
            seen.add(best)
            if fits[best] is not held and (fresh := [n for n in best_and_look_alike(fits) if n not in tried]):
                tried.update(fresh)
                fits = self._resized(fresh, suggested, fits, current)
            rivals = [n for n in rivals_of(best, fits, self.policy) if n != best]
            self.progress(f"fitting {', '.join(rivals) or 'nothing'} from the parameters of {best}")
            fits = from_best(best, rivals, fits, current, self)
        return fits

    def _resized(self, names: Sequence[str], suggested: dict, fits: dict[str, Fit], current: Fit) -> dict[str, Fit]:
        self.progress(f"trying other sizes of {', '.join(names)}")
        return from_other_sizes(names, suggested, fits, current, self)

    def _finished(self, fits: dict[str, Fit], current: Fit, held: Fit | None) -> tuple[dict[str, Fit], Fit]:
        """The best suspects fitted to the end, and the model without any, the better of two starts."""
        fits, policy = dict(fits), self.policy
        best = min(f.value for f in fits.values())
        least = {n: price(n, current.samples) + policy.believed - policy.reach for n in fits}
        hopeful = [n for n in fits if current.value - fits[n].value > least[n]]
        for name in sorted(hopeful, key=lambda name: fits[name].value)[: policy.finalists]:
            if fits[name].value < best + policy.reach and fits[name] is not held:
                self.progress(f"fitting {name} to the end")
                nearest = stepped(fits[name], current, self)
                fits[name] = self.fitted(nearest.plant, nearest)
        self.progress("fitting the model without it")
        plant = without(min(fits.values(), key=lambda f: f.value), current)
        again = self.fitted(plant, current)
        return fits, again if again.value < current.value else current

    def fitted(self, plant: Plant, start: Fit) -> Fit:
        """A plant fitted to the end, from the noise of another fit."""
        return self.fitter(plant, start.noise, start.records, anchor=self.anchor, policy=self.policy, zeros=start.zeros)

    def reduced(self, fitted: Fit, name: str) -> Fit:
        """Fitted without one of its effects."""
        plant = fitted.plant.replace(effects=tuple(e for e in fitted.plant.effects if e.name != name))
        return self.fitted(plant, fitted)

    def reconsidered(self, found: Sequence[Ranking]) -> list[Ranking]:
        """The rankings of the effects found, in the light of the last: a look-alike may have taken the place of one
        while the other was missing. Effects that have become superfluous or slight go, others may be exchanged."""
        found, policy = list(found), self.policy
        current, changed = found[-1][0].fit, False
        for ranking in found[:-1]:
            name = ranking[0].name
            self.progress(f"reconsidering {name}")
            reduced = self.reduced(current, name)
            others = [r for r in found if r is not ranking]
            nearest = stepped(current, reduced, self)
            if nearest is not current:
                current, changed = self.fitted(nearest.plant, nearest), True
            gain = reduced.value - current.value
            if gain - price(name, current.samples) < policy.believed or slight(name, gain, others, policy):
                found, current, changed = others, reduced, True
            elif any(s.net > policy.contested * ranking[0].net for s in ranking[1:]):
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
