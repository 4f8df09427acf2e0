"""Names in the light of data that no fit saw: these choose among look-alikes, and then each name is verified by itself,
so that a false one goes and the right ones stay."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from ...estimation.pool import mapped, shared_pool
from .fits import Fit
from .forward import Naming
from .judge import Witness
from .multistart import between
from .search import Search
from .suspects import Suspect, alike, follows_a_law, price_in


def upheld(naming: Naming, search: Search, witness: Witness) -> Naming:
    """The names without those that data which no fit saw speak against, each dropped in turn and the rest refitted. A
    look-alike that these data agree with takes the place of a name that they do not. A name of which they cannot judge
    stays."""
    while len(naming.accepted) > 1:
        search.progress("verifying the names one by one")
        final, accepted = naming.final, naming.accepted
        names = [suspect.name for suspect in accepted]
        reduced = list(mapped(shared_pool(), partial(search.reduced, final), names))
        asked = _asked(final, reduced, accepted, search, witness)
        # of what follows the clock other logs say nothing
        timed = [not witness.same_clock and suspect.type.follows_clock for suspect in accepted]
        witness.hears([fitted for pair, alone in zip(asked, timed, strict=True) if not alone for fitted in pair])
        idle = [
            i
            for i, fitted in enumerate(reduced)
            if _pays_nothing(accepted[i], fitted, final, search) and not witness.confirms(fitted, final)
        ]
        denied = idle or [i for i, pair in enumerate(asked) if witness.denies(*pair)]
        for gone in sorted(denied, key=lambda i: reduced[i].value):
            comparable = asked[gone][1] is final  # a look-alike would be judged beside what follows the clock
            in_place = None if idle or not comparable else _exchanged(naming, gone, reduced[gone], search, witness)
            if in_place or idle or not witness.excuses(*asked[gone]):
                naming = in_place or without_name(naming, gone, search.to_the_end(reduced[gone]), taken_back=not idle)
                break
        else:
            break
    return naming


def _asked(
    final: Fit, reduced: Sequence[Fit], accepted: Sequence[Suspect], search: Search, witness: Witness
) -> list[tuple[Fit, Fit]]:
    """Each name's fits without and with it that held-out data judge it by.

    What follows the clock of the fitted log does not happen again in another one, and would spoil every prediction
    there. The other names are then judged in fits without it."""
    names = [suspect.name for suspect in accepted]
    clocked = [suspect.name for suspect in accepted if suspect.type.follows_clock]
    if witness.same_clock or not clocked or len(clocked) == len(names):
        return [(fitted, final) for fitted in reduced]
    timeless = reduced[names.index(clocked[0])]
    for name in clocked[1:]:
        timeless = search.reduced(timeless, name)
    others = [name for name in names if name not in clocked]
    without = dict(zip(others, mapped(shared_pool(), partial(search.reduced, timeless), others), strict=True))
    return [
        (without[name], timeless) if name in without else (fitted, final)
        for name, fitted in zip(names, reduced, strict=True)
    ]


def without_name(naming: Naming, gone: int, reduced: Fit, taken_back: bool = False) -> Naming:
    """The names without one, which held-out data took back or another made superfluous."""
    return replace(
        naming,
        final=reduced,
        accepted=_but(naming.accepted, gone),
        equals=_but(naming.equals, gone),
        rankings=_but(naming.rankings, gone),
        taken_back=(*naming.taken_back, naming.accepted[gone]) if taken_back else naming.taken_back,
    )


def _pays_nothing(suspect: Suspect, reduced: Fit, final: Fit, search: Search) -> bool:
    """Whether a name has become superfluous beside those found after it."""
    return reduced.value - final.value - price_in(final, suspect.name) < search.policy.believed


def preferred(naming: Naming, search: Search, witness: Witness) -> Naming:
    """The names with others in their place where data which no fit saw ask for it by more than the fitted logs speak
    against it: what one experiment cannot tell apart, another one may. Asked only while predictions are not
    adequate; of look-alikes that explain less of the fitted logs, only while they are far off."""
    refused: set[tuple[str, str]] = set()
    policy = search.policy
    while _shown(naming, search, policy.contested, refused) and witness.off(naming.final):
        share = policy.contested if witness.far(naming.final) else policy.as_good
        pairs = _shown(naming, search, share, refused)
        before, accepted = naming.final, naming.accepted
        for i, s in pairs:
            search.progress(f"asking held-out data about {s.name} in place of {accepted[i].name}")
        tried = _tried(naming, pairs, search)
        witness.hears([before, *tried])
        for (i, s), fitted in zip(pairs, tried, strict=True):
            refused.add((accepted[i].name, s.name))
            if witness.prefers(before, fitted):
                loss = fitted.value - before.value
                gain = accepted[i].gain - loss
                found = replace(s, gain=gain, net=gain - price_in(fitted, s.name), fit=fitted)
                naming = _in_place(naming, i, found)
                break
        else:
            return naming
    return naming


def _shown(naming: Naming, search: Search, share: float, refused: set[tuple[str, str]]) -> list[tuple[int, Suspect]]:
    """What held-out data are asked about, each with the place of the name in whose place it may be."""
    pairs = [(i, s) for i in range(len(naming.accepted)) for s in _alternatives(naming, i, search, share)]
    return [(i, s) for i, s in pairs if (naming.accepted[i].name, s.name) not in refused]


def _tried(naming: Naming, pairs: Sequence[tuple[int, Suspect]], search: Search) -> list[Fit]:
    """The fits of what may be in the place of a name."""

    def fitted(pair: tuple[int, Suspect]) -> Fit:
        i, s = pair
        return _fitted_in_place(naming.accepted[i], s, naming.final, search)

    return list(mapped(shared_pool(), fitted, pairs))


def _exchanged(naming: Naming, gone: int, reduced: Fit, search: Search, witness: Witness) -> Naming | None:
    """The names with a look-alike in the place of one that held-out data speak against: one that explains the fitted
    logs nearly as well, and held-out data besides. None if there is none."""
    false = naming.accepted[gone]
    for s in _alternatives(naming, gone, search, search.policy.as_good):
        search.progress(f"trying {s.name} in place of {false.name}")
        fitted = _fitted_in_place(false, s, reduced, search)
        gain = reduced.value - fitted.value
        found = Suspect(s.name, gain, gain - price_in(fitted, s.name), fitted, s.score)
        if found.net > search.policy.believed and not witness.denies(reduced, fitted):
            return replace(_in_place(naming, gone, found), taken_back=(*naming.taken_back, false))
    return None


def _alternatives(naming: Naming, i: int, search: Search, share: float) -> list[Suspect]:
    """What may be in the place of a name, and is not there already: look-alikes that explain at least a `share` of what
    it explains of the fitted logs, and what was found before it and went when it joined. A ripple that is not seen to
    repeat does not take the place of a spring or cable: it is one."""
    own = naming.accepted[i]
    taken = {e.name for e in naming.final.plant.effects} | {s.name for s in naming.taken_back}
    look_alikes = [s for s in naming.rankings[i] if alike(s.name, own.name) and s.gain > share * own.gain]
    found = [s for s in (*look_alikes, *naming.went.get(own.name, ())) if s.name not in taken]
    return [s for s in found if not (own.type.of_angle_alone and follows_a_law(s, search.policy))]


def _fitted_in_place(false: Suspect, s: Suspect, start: Fit, search: Search) -> Fit:
    """A fit with one effect in the place of another; `start` may have that one still, or be fitted without it."""
    effect = s.fit.plant.effect(s.name)
    assert effect is not None
    plant = start.plant.without(false.name).with_effects(effect)
    return search.fitted(plant, replace(start, noise=between(s.fit, start)), "full")


def _in_place(naming: Naming, i: int, found: Suspect) -> Naming:
    """The names with another one at place i. What only described the law of the former describes the law of this."""
    former = naming.accepted[i].name

    def exchanged(values: tuple, value: object) -> tuple:
        return (*values[:i], value, *values[i + 1 :])

    def renamed(name: str) -> str:
        return found.name if name == former else name

    return replace(
        naming,
        final=found.fit,
        accepted=exchanged(naming.accepted, found),
        equals=exchanged(naming.equals, ()),
        rankings=exchanged(naming.rankings, (found, *(s for s in naming.rankings[i] if s.name != found.name))),
        laws={renamed(name): renamed(of) for name, of in naming.laws.items()},
    )


def _but(values: tuple, gone: int) -> tuple:
    return values[:gone] + values[gone + 1 :]
