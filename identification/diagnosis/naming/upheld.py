"""Names in the light of data that no fit saw: these choose among look-alikes, and then each name is verified by itself,
so that a false one goes and the right ones stay."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import partial

from furuta_gym.plant import Plant

from ...estimation.pool import mapped, shared_pool
from .fits import Fit
from .found import FoundEffect, Naming
from .judge import Witness
from .multistart import between
from .search import Search
from .suspects import Suspect, alike, may_replace, price_in


@dataclass(frozen=True)
class _Asked:
    """What held-out data are asked about an effect found: the fits `without` and with it, `fitted`, that they judge it
    by. reduced: the fit of all others."""

    effect: FoundEffect
    reduced: Fit
    without: Fit
    fitted: Fit


@dataclass(frozen=True, eq=False)
class _Exchange:
    """A suspect in the place of an effect found."""

    former: FoundEffect
    by: Suspect

    @property
    def names(self) -> tuple[str, str]:
        return self.former.name, self.by.name


def upheld(naming: Naming, search: Search, witness: Witness) -> Naming:
    """The names without those that data which no fit saw speak against, each dropped in turn and the rest refitted. A
    look-alike that these data agree with takes the place of a name that they do not. A name of which they cannot judge
    stays."""
    while len(naming.found) > 1:
        search.progress("verifying the names one by one")
        final = naming.final
        every = _asked(naming, search, witness)
        # of what follows the clock other logs say nothing
        judged = [a for a in every if witness.same_clock or not a.effect.type.follows_clock]
        witness.hears([fitted for a in judged for fitted in (a.without, a.fitted)])
        idle = [a for a in every if _pays_nothing(a, final, search) and not witness.confirms(a.reduced, final)]
        denied = idle or [a for a in every if witness.denies(a.without, a.fitted)]
        for a in sorted(denied, key=lambda a: a.reduced.value):
            comparable = a.fitted is final  # a look-alike would be judged beside what follows the clock
            in_place = None if idle or not comparable else _exchanged(naming, a, search, witness)
            if in_place or idle or not witness.excuses(a.without, a.fitted):
                naming = in_place or without_name(naming, a.effect, search.to_the_end(a.reduced), taken_back=not idle)
                break
        else:
            break
    return naming


def _asked(naming: Naming, search: Search, witness: Witness) -> list[_Asked]:
    """Each name's fits without and with it that held-out data judge it by.

    What follows the clock of the fitted log does not happen again in another one, and would spoil every prediction
    there. The other names are then judged in fits without it."""
    final, names = naming.final, naming.names
    reduced = dict(zip(names, mapped(shared_pool(), partial(search.reduced, final), names), strict=True))
    clocked = [effect.name for effect in naming.found if effect.type.follows_clock]
    if witness.same_clock or not clocked or len(clocked) == len(names):
        return [_Asked(effect, reduced[effect.name], reduced[effect.name], final) for effect in naming.found]
    timeless = reduced[clocked[0]]
    for name in clocked[1:]:
        timeless = search.reduced(timeless, name)
    others = [name for name in names if name not in clocked]
    without = dict(zip(others, mapped(shared_pool(), partial(search.reduced, timeless), others), strict=True))
    asked = []
    for effect in naming.found:
        alone = reduced[effect.name]
        judged_in = (without[effect.name], timeless) if effect.name in without else (alone, final)
        asked.append(_Asked(effect, alone, *judged_in))
    return asked


def without_name(naming: Naming, gone: FoundEffect, reduced: Fit, taken_back: bool = False) -> Naming:
    """The names without one, which held-out data took back or another made superfluous."""
    return replace(
        naming,
        final=reduced,
        found=tuple(effect for effect in naming.found if effect.name != gone.name),
        taken_back=(*naming.taken_back, gone.suspect) if taken_back else naming.taken_back,
    )


def _pays_nothing(asked: _Asked, final: Fit, search: Search) -> bool:
    """Whether a name has become superfluous beside those found after it."""
    return asked.reduced.value - final.value - price_in(final, asked.effect.name) < search.policy.believed


def preferred(naming: Naming, search: Search, witness: Witness) -> Naming:
    """The names with others in their place where data which no fit saw ask for it by more than the fitted logs speak
    against it: what one experiment cannot tell apart, another one may. Asked only while predictions are not
    adequate; of look-alikes that explain less of the fitted logs, only while they are far off."""
    refused: set[tuple[str, str]] = set()
    policy = search.policy
    while _shown(naming, search, policy.contested, refused) and witness.off(naming.final):
        share = policy.contested if witness.far(naming.final) else policy.as_good
        exchanges = _shown(naming, search, share, refused)
        before = naming.final
        for exchange in exchanges:
            search.progress(f"asking held-out data about {exchange.by.name} in place of {exchange.former.name}")
        tried = _tried(exchanges, before, search, witness)
        refused |= {exchange.names for exchange in exchanges if exchange not in tried}
        for exchange, fitted in tried.items():
            refused.add(exchange.names)
            if witness.prefers(before, fitted):
                loss = fitted.value - before.value
                gain = exchange.former.suspect.gain - loss
                net = gain - price_in(fitted, exchange.by.name)
                naming = _in_place(naming, exchange.former, replace(exchange.by, gain=gain, net=net, fit=fitted))
                break
        else:
            return naming
    return naming


def _shown(naming: Naming, search: Search, share: float, refused: Collection[tuple[str, str]]) -> list[_Exchange]:
    """What held-out data are asked about."""
    every = [exchange for effect in naming.found for exchange in _alternatives(naming, effect, search, share)]
    return [exchange for exchange in every if exchange.names not in refused]


def _exchanged(naming: Naming, false: _Asked, search: Search, witness: Witness) -> Naming | None:
    """The names with a look-alike in the place of one that held-out data speak against: one that explains the fitted
    logs nearly as well, and held-out data besides. None if there is none."""
    former, reduced = false.effect, false.reduced
    for exchange in _alternatives(naming, former, search, search.policy.as_good):
        s = exchange.by
        search.progress(f"trying {s.name} in place of {former.name}")
        fitted = search.fitted(*_placed(exchange, reduced), "full")
        gain = reduced.value - fitted.value
        found = Suspect(s.name, gain, gain - price_in(fitted, s.name), fitted, s.score)
        if found.net > search.policy.believed and not witness.denies(reduced, fitted):
            return replace(_in_place(naming, former, found), taken_back=(*naming.taken_back, former.suspect))
    return None


def _alternatives(naming: Naming, former: FoundEffect, search: Search, share: float) -> list[_Exchange]:
    """What may be in the place of a name, and is not there already: look-alikes that explain at least a `share` of what
    it explains of the fitted logs, and what was found before it and went when it joined."""
    taken = {e.name for e in naming.final.plant.effects} | {s.name for s in naming.taken_back}
    look_alikes = [s for s in former.ranking if alike(s.name, former.name) and s.gain > share * former.suspect.gain]
    found = [s for s in (*look_alikes, *naming.went.get(former.name, ())) if s.name not in taken]
    kept = [s for s in found if may_replace(former.suspect, s, search.policy)]
    return [_Exchange(former, s) for s in kept]


def _tried(exchanges: Sequence[_Exchange], before: Fit, search: Search, witness: Witness) -> dict[_Exchange, Fit]:
    """Fits to the end of the exchanges that held-out data may prefer. One that is far behind on the fitted logs is only
    fitted quickly where these data do not ask for it."""

    def in_place(exchange: _Exchange) -> Fit:
        return search.fitted(*_placed(exchange, before), "quick")

    def to_the_end(rough: Fit) -> Fit:
        return search.fitted(rough.plant, rough, "full")

    quick = list(mapped(shared_pool(), in_place, exchanges))
    witness.hears([before, *quick])
    hopeful = {
        exchange: rough
        for exchange, rough in zip(exchanges, quick, strict=True)
        if not search.far_behind(rough, before) or witness.confirms(before, rough)
    }
    fitted = list(mapped(shared_pool(), to_the_end, hopeful.values()))
    witness.hears(fitted)
    return dict(zip(hopeful, fitted, strict=True))


def _placed(exchange: _Exchange, start: Fit) -> tuple[Plant, Fit]:
    """Where a fit with one effect in the place of another starts: its plant, and the fit whose noise and zeros it has.
    `start` may have the other one still, or be fitted without it."""
    s = exchange.by
    effect = s.fit.plant.effect(s.name)
    assert effect is not None
    plant = start.plant.without(exchange.former.name).with_effects(effect)
    return plant, replace(start, noise=between(s.fit, start))


def _in_place(naming: Naming, former: FoundEffect, by: Suspect) -> Naming:
    """The names with another one in the place of the former. What only described its law describes the law of this."""
    ranking = (by, *(s for s in former.ranking if s.name != by.name))

    def renamed(name: str) -> str:
        return by.name if name == former.name else name

    return replace(
        naming,
        final=by.fit,
        found=tuple(FoundEffect(ranking) if e.name == former.name else e for e in naming.found),
        laws={renamed(name): renamed(of) for name, of in naming.laws.items()},
    )
