"""Which effects are missing: forward selection, suspects compared by likelihood net of what their parameters cost.

Suspects that the data cannot tell apart are kept as a set of equals.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

from furuta_gym.plant import EFFECTS

from ...kalman.noise_model import Noise
from ..locate.location import Where
from ..policy import DecisionPolicy
from .fits import Fit
from .found import FoundEffect, Naming
from .judge import Judge, Rest, Witness
from .next_effect import next_effect
from .pairs import two_for_one
from .scores import Score
from .search import NOTHING_YET, Search
from .suspects import Ranking, Suspect, alike
from .wider import widened

START_NOISE = Noise((1e-3, 1e-5), (0.5, 0.5))
_AGAIN = 2
"""How often suspects are compared again because the model without them had stalled."""


@dataclass(frozen=True)
class _Grown:
    """Where a forward selection stands: the model without and with the effects found, and the step that found no
    more."""

    nominal: Fit
    current: Fit
    found: tuple[Ranking, ...] = ()
    last: Ranking = ()
    absorbed: dict[str, float] = field(default_factory=dict)
    refused: Suspect | None = None
    laws: Mapping[str, str] = field(default_factory=dict)
    went: Mapping[str, tuple[Suspect, ...]] = field(default_factory=dict)
    alone: Fit | None = None
    ended_early: bool = False


def name_effects(
    nominal: Fit,
    search: Search,
    most: int,
    rest: Rest,
    witness: Witness,
    joined: Mapping[str, Fit],
) -> Naming:
    """Forward selection; each effect found is reconsidered when another one joins it, and one alone is compared with
    two.

    nominal: the model without effects. most: effects at most. rest: what fits leave; a further effect that leaves
    more than it explains, or that only describes another law of one before it, is not what is missing. witness: while
    a model is far off on data that no fit saw, these decide about a further effect, and not how small it is beside the
    largest. joined: fits with one effect from other starts.
    """
    judge = Judge(search.policy, rest, witness)
    grown = _grow(search, _Grown(nominal, nominal), most, judge, joined)
    single = len(grown.found) == 1 < most
    if single and search.late:
        grown = replace(grown, ended_early=True)
    elif single and (two := two_for_one(search, grown.found[0], grown.nominal)):
        pair = _Grown(grown.nominal, two[-1][0].fit, two, (), grown.absorbed, alone=grown.alone)
        grown = _grow(search, pair, most, judge)
    taken = {ranking[0].name for ranking in grown.found}
    return Naming(
        grown.nominal,
        grown.current,
        tuple(FoundEffect(ranking, _equals(ranking, taken, search.policy)) for ranking in grown.found),
        (grown.last,) if grown.last else (),
        grown.absorbed,
        grown.refused,
        laws=grown.laws,
        went=grown.went,
        alone=grown.alone,
        ended_early=grown.ended_early,
    )


def _equals(ranking: Ranking, taken: Collection[str], policy: DecisionPolicy) -> tuple[str, ...]:
    """Of a ranking, what gains as much as its first. What acts beside it is not in its place: `taken`."""
    first, *others = ranking
    return tuple(s.name for s in others if first.net - s.net < policy.equal and s.name not in taken)


def _grow(search: Search, so_far: _Grown, most: int, judge: Judge, joined: Mapping[str, Fit] = NOTHING_YET) -> _Grown:
    """Effects added one at a time, until no further one is believed.

    An effect that leaves more than it explains, or is small beside the others, stays for the time being: where several
    are missing, it may be right, and only the next ones show it. In the end they must leave less than it explains,
    or, if it is small, data that no fit saw must ask for it. What only describes another law of an effect found stays
    where such data ask for it."""
    nominal, current, absorbed, alone = so_far.nominal, so_far.current, so_far.absorbed, so_far.alone
    found, last, refused = list(so_far.found), (), None
    laws, went, ended_early = so_far.laws, dict(so_far.went), False
    doubts: list[tuple[_Grown, bool]] = []  # before each doubtful effect, and whether it is small
    for step in range(len(found), most):
        if ended_early := bool(found) and search.late:
            break
        tried = _compared(search, judge, current, found, step, joined)
        for _ in range(_AGAIN):
            if not tried.stalled(search.policy):
                break
            current = tried.current
            if found:
                found, current = search.ranked_again(found, current)
            tried = _compared(search, judge, current, found, step, joined)
        current, last = tried.current, tried.ranking
        if step == 0:
            absorbed = {name: s.absorbed for name, s in tried.table.items()}
            nominal, alone = current, last[0].fit if last else None
        if not last or last[0].net < search.policy.believed:
            break
        if not tried.worth(last[0].gain):
            refused = last[0]
            break
        if judge.much_left(found, last[0]) and judge.takes_shape(found, last[0], current):
            current, last = search.refits(current, tried.names, tried.table, thorough=True, worth=tried.worth)
        newest = next_effect(search, judge, found, last, current, laws)
        if newest is None:
            refused = last[0]
            break
        if newest.in_doubt:
            so_far = _Grown(nominal, current, tuple(found), last, absorbed, last[0], laws, dict(went), alone)
            doubts.append((so_far, newest.small))
        laws, together = newest.laws, newest.together
        went |= _went(found, together)
        found, last, current = list(together), (), together[-1][0].fit
        current = widened(current, search)
        found = [*found[:-1], (replace(found[-1][0], fit=current), *found[-1][1:])]
    for before, small in doubts:
        explained = not small and judge.rest.left(current) <= before.last[0].net
        if not (explained or judge.confirmed(before.current, current)):
            return replace(before, ended_early=ended_early)
    return _Grown(nominal, current, tuple(found), last, absorbed, refused, laws, went, alone, ended_early)


@dataclass(frozen=True)
class _Compared:
    """The suspects of a step, and the model without any, which may be a better fit than `before`."""

    before: Fit
    current: Fit
    ranking: Ranking
    names: list[str]
    table: dict[str, Score]
    worth: Callable[[float], bool]

    def stalled(self, policy: DecisionPolicy) -> bool:
        """Whether no suspect is believed, and all were compared with a fit that had stalled."""
        believed = bool(self.ranking) and self.ranking[0].net >= policy.believed
        return not believed and self.before.value - self.current.value >= policy.believed


def _compared(
    search: Search, judge: Judge, current: Fit, found: Sequence[Ranking], step: int, joined: Mapping[str, Fit]
) -> _Compared:
    """The library scored, and what may be missing fitted. joined: see `name_effects`."""
    search.progress(f"scoring the library (step {step + 1})")
    names, table = search.suspects(current, step)
    worth = partial(judge.counts, list(found), current=current)
    complete = step > 0 and bool(names) and judge.rest.left(current) <= 0.0
    joining = NOTHING_YET if step else joined
    fitted, ranking = search.refits(current, names, table, joined=joining, worth=worth, nothing_left=complete)
    return _Compared(current, fitted, ranking, names, table, worth)


def _went(found: Sequence[Ranking], together: Sequence[Ranking]) -> dict[str, tuple[Suspect, ...]]:
    """The effects found that went when another joined, by the one that took their place: a suspect of the same ranking,
    or else the last to join."""
    went: dict[str, tuple[Suspect, ...]] = {}
    for gone, *_ in found:
        if gone.name not in {ranking[0].name for ranking in together}:
            ranked = (r[0].name for r in together if any(s.name == gone.name for s in r))
            by = next(ranked, together[-1][0].name)
            went[by] = (*went.get(by, ()), gone)
    return went


def unsettled(naming: Naming, remains: Where, policy: DecisionPolicy) -> Naming:
    """The same with more equals, where structure is left, as none of the names is all of the truth then. A look-alike
    of the variable that the rest goes with may as well be the name if it explains nearly as much: the form is wrong.
    So may any suspect that explains all but a hundredth or two."""
    if not remains.matters:
        return naming
    taken = naming.names
    return replace(naming, found=tuple(_with_rivals(effect, taken, remains, policy) for effect in naming.found))


def _with_rivals(effect: FoundEffect, taken: Sequence[str], remains: Where, policy: DecisionPolicy) -> FoundEffect:
    """An effect found with more equals: see `unsettled`. taken: names of what is found."""
    gain, formed = effect.suspect.gain, _acts_on(effect.name, remains)
    rivals = []
    for s in effect.ranking:
        another_form = formed and _acts_on(s.name, remains) and alike(s.name, effect.name)
        as_good = s.gain > policy.nearly * gain or (another_form and s.gain > policy.as_good * gain)
        if as_good and s.name not in {*taken, *effect.equals}:
            rivals.append(s.name)
    return replace(effect, equals=(*effect.equals, *rivals))


def _acts_on(name: str, remains: Where) -> bool:
    """Whether an effect depends on what the rest goes with, in the same place."""
    effect = EFFECTS[name]
    if remains.variable is None or remains.channel is None:
        return False
    depends = any(remains.variable.argument in arguments for arguments in effect.arguments.values())
    return depends and remains.channel in effect.place
