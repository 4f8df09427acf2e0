"""Names that hold on data which no fit saw: each is verified by itself, so that a false one goes and the right ones
stay."""

from __future__ import annotations

from dataclasses import replace

from .fits import Fit
from .forward import Naming
from .judge import Witness
from .multistart import between
from .search import Search
from .suspects import Suspect, alike, price


def upheld(naming: Naming, search: Search, witness: Witness) -> Naming:
    """The names without those that data which no fit saw speak against, each dropped in turn and the rest refitted. A
    look-alike that these data agree with takes the place of a name that they do not."""
    while len(naming.accepted) > 1:
        search.progress("verifying the names one by one")
        reduced = [search.reduced(naming.final, suspect.name) for suspect in naming.accepted]
        idle = [
            i for i, fitted in enumerate(reduced) if _pays_nothing(naming.accepted[i], fitted, naming.final, search)
        ]
        denied = idle or [i for i, fitted in enumerate(reduced) if witness.denies(fitted, naming.final)]
        if not denied:
            break
        gone = min(denied, key=lambda i: reduced[i].value)
        in_place = None if idle else _exchanged(naming, gone, reduced[gone], search, witness)
        naming = in_place or replace(
            naming,
            final=reduced[gone],
            accepted=_but(naming.accepted, gone),
            equals=_but(naming.equals, gone),
            rankings=_but(naming.rankings, gone),
            taken_back=naming.taken_back if idle else (*naming.taken_back, naming.accepted[gone]),
        )
    return naming


def _pays_nothing(suspect: Suspect, reduced: Fit, final: Fit, search: Search) -> bool:
    """Whether a name has become superfluous beside those found after it."""
    return reduced.value - final.value - price(suspect.name, final.samples) < search.policy.believed


def _exchanged(naming: Naming, gone: int, reduced: Fit, search: Search, witness: Witness) -> Naming | None:
    """The names with a look-alike in the place of one that held-out data speak against: one that explains the fitted
    logs nearly as well, and held-out data besides. None if there is none."""
    false, ranking = naming.accepted[gone], naming.rankings[gone]
    taken = {e.name for e in reduced.plant.effects} | {s.name for s in naming.taken_back}
    for s in ranking:
        effect = s.fit.plant.effect(s.name)
        near = alike(s.name, false.name) and s.gain > search.policy.as_good * false.gain
        if not near or effect is None or s.name in taken:
            continue
        search.progress(f"trying {s.name} in place of {false.name}")
        fitted = search.fitted(
            reduced.plant.with_effects(effect), replace(reduced, noise=between(s.fit, reduced)), "full"
        )
        gain = reduced.value - fitted.value
        found = Suspect(s.name, gain, gain - price(s.name, fitted.samples), fitted, s.score)
        if found.net > search.policy.believed and not witness.denies(reduced, fitted):
            return replace(
                naming,
                final=fitted,
                accepted=(*naming.accepted[:gone], found, *naming.accepted[gone + 1 :]),
                equals=(*naming.equals[:gone], (), *naming.equals[gone + 1 :]),
                rankings=(*naming.rankings[:gone], (found, *ranking), *naming.rankings[gone + 1 :]),
                taken_back=(*naming.taken_back, false),
            )
    return None


def _but(values: tuple, gone: int) -> tuple:
    return values[:gone] + values[gone + 1 :]
