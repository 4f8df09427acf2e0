"""The steps of forward selection: which effects are suspected, how they are fitted, and which are fitted again when
another joins.

Every suspect is fitted together with θ and the noise intensities (frozen noise hides most of the evidence, and θ fitted
without the effect carries part of it).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from furuta_gym.plant import EFFECTS, Effect, Plant

from ...estimation.pool import mapped, shared_pool
from ...estimation.prediction_error import quietest
from ..policy import DecisionPolicy
from .comparison import Comparison
from .discrete import starts_of, stepped
from .dropped import dropped
from .fits import Effort, Fit, FitRequest, Fitter, added, fit
from .multistart import best_and_look_alike, best_of, from_best, from_other_sizes, look_alikes, multi_start
from .scores import Score, scores
from .suspects import Ranking, Suspect, may_replace, plainer, price, price_in, shortlist, slight_beside

Scorer = Callable[..., dict[str, Score]]


NOTHING_YET: Mapping[str, Fit] = {}
"""No fits."""


def _silent(text: str) -> None:
    """Progress that nobody wants."""


@dataclass(frozen=True)
class Search:
    """What stays the same from step to step.

    anchor: plant of the weak prior. only: names of effects to consider (None: all). progress(text) is called at each
    step. fitter, scorer: what fits and scores; tests put stand-ins there. until: time (of `time.monotonic`) after which
    no further step is begun.
    """

    anchor: Plant
    only: Sequence[str] | None = None
    policy: DecisionPolicy = field(default_factory=DecisionPolicy)
    progress: Callable[[str], None] = _silent
    fitter: Fitter = fit
    scorer: Scorer = scores
    until: float = math.inf

    @property
    def late(self) -> bool:
        """Whether the time given is over."""
        return time.monotonic() > self.until

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
            try:
                quiet = self.scorer(current, self.only, quieter=policy.quieter, policy=policy)
            except ValueError:  # the filter loses the log at so little noise
                quiet = {}
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
        joined: Mapping[str, Fit] = NOTHING_YET,
        worth: Callable[[float], bool] = lambda gain: True,
        effort: Effort = "restarted",
        nothing_left: bool = False,
    ) -> tuple[Fit, Ranking]:
        """Suspects fitted; the model without any is fitted again from the best one's θ, so that neither stopped early.

        held: a fit with an effect more than `current` that takes part as it is. joined: coarse fits of effects from
        elsewhere; the best of them replaces a start at θ of `current`. worth(gain [nats]): whether the best
        is fitted to the end, with what effort; else it stays as coarsely fitted as it is. nothing_left: `current`
        leaves no structure; then no other starts are tried where the first ones do not pay for their parameters.
        """
        suggested = {name: start for name in names if (start := table[name].start) is not None}
        if held is not None:
            suggested[added(held, current).name] = added(held, current)
        suggested |= {name: added(fitted, current) for name, fitted in joined.items()}
        if not suggested:
            return current, ()
        if held is not None:  # its θ is near the truth, and that of `current` is not: see `from_best`
            fits = {added(held, current).name: held}
        else:
            fits = dict(joined) or self._started(current, suggested, thorough)
        comparison = Comparison(fits, suggested, table, current, held, effort, resized=set(joined))
        hopeless = nothing_left and all(current.value - f.value < price_in(f, name) for name, f in fits.items())
        if not hopeless:
            self._compare(comparison)
        if not hopeless and worth(current.value - comparison.best.value):
            before = comparison.best.value
            comparison.current = self._finish(comparison)
            if comparison.best.value < before - self.policy.reach:  # the best had stalled: the others may have, too
                self._compare(comparison)
                comparison.current = self._finish(comparison)
            current = comparison.current
        ranking = _ranking(comparison, current)
        if (plain := plainer(ranking, self.policy)) is not None:
            self.progress(f"fitting {plain.name} in place of a ripple that follows its law")
            comparison.fits[plain.name] = self.fitted(plain.fit.plant, plain.fit, effort)
            by_name = {s.name: s for s in _ranking(comparison, current)}
            first = by_name.pop(plain.name)
            ranking = (first, *by_name.values())
        return current, ranking

    def _started(self, current: Fit, suggested: dict[str, Effect], thorough: bool) -> dict[str, Fit]:
        """A coarse fit of every suspect from what its score suggests, and from other sizes where all went astray."""
        self.progress(f"fitting {', '.join(suggested)}")
        starts = [at for start in suggested.values() for at in starts_of(start, current, self)]
        fits = best_of(multi_start(starts, current, self))
        # worse than without any: all went astray
        if thorough or min(f.value for f in fits.values()) > current.value + self.policy.reach:
            fits = self._resized(list(fits), suggested, fits, current)
        return fits

    def _compare(self, comparison: Comparison) -> None:
        """Coarse fits until the best stays the best: it and its nearest look-alike from other sizes, its declared
        look-alikes and the next in order from its θ. A best that has improved is compared again."""
        current, suggested = comparison.current, comparison.suggested
        for _ in range(2 * len(EFFECTS)):
            best = comparison.name
            if comparison.best.value > comparison.led.get(best, math.inf) - self.policy.reach:
                break
            comparison.led[best] = comparison.best.value
            fresh = [n for n in best_and_look_alike(comparison.fits) if n not in comparison.resized and n in suggested]
            if comparison.best is not comparison.held and fresh:
                comparison.resized.update(fresh)
                comparison.fits = self._resized(fresh, suggested, comparison.fits, current)
                best = comparison.name
            rivals = comparison.rivals(self.policy)
            self.progress(f"fitting {', '.join(rivals) or 'nothing'} from the parameters of {best}")
            comparison.fits = from_best(best, rivals, comparison.fits, current, self)

    def _resized(self, names: Sequence[str], suggested: dict, fits: dict[str, Fit], current: Fit) -> dict[str, Fit]:
        self.progress(f"trying other sizes of {', '.join(names)}")
        return from_other_sizes(names, suggested, fits, current, self)

    def _finish(self, comparison: Comparison) -> Fit:
        """The best suspects fitted to the end; returns the model without any, the better of two starts."""
        policy, current = self.policy, comparison.current
        self._step_look_alikes(comparison)
        best = comparison.best.value
        least = {n: price_in(f, n) + policy.believed - policy.reach for n, f in comparison.fits.items()}
        hopeful = [n for n in comparison.fits if current.value - comparison.fits[n].value > least[n]]
        ranked = sorted(hopeful, key=lambda name: comparison.fits[name].value)[: policy.finalists]
        near = [name for name in ranked if comparison.fits[name].value < best + policy.reach]
        names = [
            n
            for n in near
            if comparison.fits[n] is not comparison.held and comparison.fits[n] is not comparison.finished.get(n)
        ]

        def to_the_end(name: str) -> Fit:
            nearest = stepped(comparison.fits[name], current, self)
            effort = comparison.effort if comparison.fits[name].value == best else "full"
            return self.fitted(nearest.plant, nearest, effort)

        if names:
            self.progress(f"fitting {', '.join(names)} to the end")
        pool = shared_pool() if len(names) > 1 else None  # a single fit uses the threads by itself
        comparison.finished |= zip(names, mapped(pool, to_the_end, names), strict=True)
        comparison.fits |= {name: comparison.finished[name] for name in names}
        self.progress("fitting the model without it")
        without = dropped(comparison.best, added(comparison.best, current).name)
        again = self.rival(without.plant, replace(current, zeros=without.zeros), comparison.best)
        return again if again.value < current.value else current

    def _step_look_alikes(self, comparison: Comparison) -> None:
        """Look-alikes that are behind the best, with another whole number: a score chose theirs at another θ, and no
        descent moves it."""
        best, current = comparison.best.value, comparison.current
        for name in look_alikes(comparison.name, comparison.fits):
            fitted = comparison.fits[name]
            behind = fitted.value > best + self.policy.reach
            contests = current.value - fitted.value > self.policy.contested * (current.value - best)
            if behind and contests and EFFECTS[name].whole_number:
                self.progress(f"trying other whole numbers of {name}")
                comparison.fits[name] = stepped(fitted, current, self, rough=False)

    def rival(self, plant: Plant, start: Fit, against: Fit) -> Fit:
        """A plant fitted to compare it with a better one: only as well as the difference asks for. It starts from the
        noise and zeros of another fit."""
        quick = self.fitted(plant, start, "quick")
        return quick if self.far_behind(quick, against) else self.fitted(quick.plant, quick, "full")

    def far_behind(self, quick: Fit, against: Fit) -> bool:
        """Whether a quick fit is so far behind another one that it need not be fitted to the nat."""
        catches_up = 0.0 if quick.optimum.converged else self.policy.catches_up * quick.promised
        return quick.value - against.value - catches_up > self.policy.plain

    def fitted(self, plant: Plant, start: Fit, effort: Effort = "restarted") -> Fit:
        """A plant fitted to the end, from the noise and zeros of another fit."""
        return self.fitter(
            FitRequest(
                plant,
                start.noise,
                start.records,
                anchor=self.anchor,
                policy=self.policy,
                zeros=start.zeros,
                effort=effort,
            )
        )

    def to_the_end(self, rough: Fit) -> Fit:
        """A fit that was only compared with a better one, as the model from here on."""
        return rough if rough.optimum.converged else self.fitted(rough.plant, rough, "full")

    def reduced(self, fitted: Fit, name: str) -> Fit:
        """Fitted without one of its effects; the others take its part over where they can."""
        without = dropped(fitted, name)
        return self.rival(without.plant, replace(fitted, zeros=without.zeros), fitted)

    def ranked_again(self, found: Sequence[Ranking], current: Fit) -> tuple[list[Ranking], Fit]:
        """The rankings of the effects found, and the best fit, where the fit with them had stalled and `current` is a
        lower one: the last effect is compared with its rivals again."""
        *others, ranking = found
        reduced = self.reduced(current, ranking[0].name)
        table = {s.name: Score(s.name, s.score, s.fit.plant.effect(s.name), 0.0) for s in ranking[1:]}
        _, again = self.refits(reduced, list(table), table, held=current, effort="full")
        return [*others, again], again[0].fit

    def reconsidered(
        self,
        found: Sequence[Ranking],
        asked_for: Callable[[Fit, Fit, Sequence[str]], bool],
    ) -> list[Ranking]:
        """The rankings of the effects found, in the light of the last: a look-alike may have taken the place of one
        while the other was missing. Effects that have become superfluous or slight go, others may be exchanged.

        asked_for(without, fitted, beside): whether an effect stays that is slight beside some of the others.
        """
        found, policy = list(found), self.policy
        current, changed = found[-1][0].fit, False
        for ranking in found[:-1]:
            name = ranking[0].name
            self.progress(f"reconsidering {name}")
            reduced = self.reduced(current, name)
            others = [r for r in found if r is not ranking]
            nearest = stepped(current, reduced, self, rough=False)
            if nearest is not current:
                current, changed = self.fitted(nearest.plant, nearest), True
            gain = reduced.value - current.value
            beside = slight_beside(name, gain, others, policy)
            if gain - price_in(current, name) < policy.believed or (beside and not asked_for(reduced, current, beside)):
                found, current, changed = others, self.to_the_end(reduced), True
            elif rivals := _contesting(ranking, reduced, policy):
                table = {s.name: Score(s.name, s.score, s.fit.plant.effect(s.name), 0.0) for s in rivals}
                _, again = self.refits(reduced, list(table), table, held=current, effort="full")
                changed = changed or again[0].name != name
                current = again[0].fit
                found = [again if r is ranking else r for r in found]
        if changed:
            name = found[-1][0].name
            last = found[-1][0]
            gain = self.reduced(current, name).value - current.value
            more = gain - price_in(current, name) - last.net
            # what the model without it leaves has changed for its rivals as well
            found[-1] = tuple(replace(s, gain=s.gain + gain - last.gain, net=s.net + more) for s in found[-1])
        found[-1] = (replace(found[-1][0], fit=current), *found[-1][1:])
        return found


def _ranking(comparison: Comparison, current: Fit) -> Ranking:
    """The fits as suspects, the best first."""
    suspects = []
    for name, fitted in comparison.fits.items():
        gain = current.value - fitted.value
        score = comparison.table[name].gain if name in comparison.table else 0.0
        suspects.append(Suspect(name, gain, gain - price_in(fitted, name), fitted, score))
    return tuple(sorted(suspects, key=lambda s: -s.net))


def _contesting(ranking: Ranking, reduced: Fit, policy: DecisionPolicy) -> list[Suspect]:
    """Suspects that did nearly as well as the first of their ranking, may take its place and are not in the model by
    now."""
    taken = {e.name for e in reduced.plant.effects}
    first, *others = ranking
    near = [s for s in others if s.net > policy.contested * first.net and s.name not in taken]
    return [s for s in near if may_replace(first, s, policy)]
