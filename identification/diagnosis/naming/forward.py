"""Which effects are missing: forward selection, suspects compared by likelihood net of what their parameters cost.

Suspects that the data cannot tell apart are kept as a set of equals.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Protocol

from furuta_gym.plant import EFFECTS

from ...kalman.noise_model import Noise
from ..locate.location import Where
from ..policy import DecisionPolicy
from .fits import Fit
from .pairs import two_for_one
from .search import NOTHING_YET, Search
from .suspects import Ranking, Suspect, alike, slight

START_NOISE = Noise((1e-3, 1e-5), (0.5, 0.5))
_VARIABLES = {"u": "command", "q1": "arm angle", "v1": "arm speed", "q2": "pendulum angle", "v2": "pendulum speed"}


@dataclass(frozen=True)
class Naming:
    """Outcome of the search: the model without and with the effects found, and every suspect of each step.

    accepted: the effects found. equals: beside each of them, what cannot be told from it. absorbed: share of each
    effect's response that θ can imitate on these logs. refused: what would explain some more, but too little to be
    told from a wrong form. taken_back: what explains some of these logs, but not of data that no fit saw.
    same: of the equals, those that predict the same, so that nobody need tell them apart.
    """

    nominal: Fit = field(repr=False)
    final: Fit = field(repr=False)
    accepted: tuple[Suspect, ...]
    equals: tuple[tuple[str, ...], ...]
    rankings: tuple[Ranking, ...]
    absorbed: dict[str, float]
    refused: Suspect | None = None
    taken_back: tuple[Suspect, ...] = ()
    same: tuple[tuple[str, ...], ...] = ()

    @property
    def apart(self) -> tuple[tuple[str, ...], ...]:
        """Beside each effect found, the equals that predict something else."""
        same = self.same or tuple(() for _ in self.equals)
        return tuple(tuple(n for n in e if n not in s) for e, s in zip(self.equals, same, strict=True))


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


Left = Callable[[Fit], float]
"""Evidence [nats] of torques that a fit does not explain."""


def nothing_left(fitted: Fit) -> float:
    """A `Left` that never sees anything."""
    return 0.0


Change = Callable[[Fit, Fit, str], float]
"""How much a further effect changes the torques of a model, as a share of the torque of an effect found before;
infinite where nobody can say."""


def never_small(before: Fit, after: Fit, other: str) -> float:
    """A `Change` that says nothing."""
    return math.inf


class Witness(Protocol):
    """Data that no fit saw."""

    def far(self, fitted: Fit) -> bool:
        """Whether a fit predicts them much worse than noise would."""
        ...

    def confirms(self, without: Fit, fitted: Fit) -> bool:
        """Whether a further effect brings the prediction nearer for certain, and by a share that matters."""
        ...

    def denies(self, without: Fit, fitted: Fit) -> bool:
        """Whether they speak against one effect beside others."""
        ...


class NoWitness:
    """A `Witness` that never says anything."""

    def far(self, fitted: Fit) -> bool:
        return False

    def confirms(self, without: Fit, fitted: Fit) -> bool:
        return False

    def denies(self, without: Fit, fitted: Fit) -> bool:
        return False


def name_effects(
    nominal: Fit,
    search: Search,
    most: int = 6,
    left: Left = nothing_left,
    witness: Witness = NoWitness(),  # noqa: B008  (no state)
    joined: Mapping[str, Fit] = NOTHING_YET,
    change: Change = never_small,
) -> Naming:
    """Forward selection; each effect found is reconsidered when another one joins it, and one alone is compared with
    two.

    nominal: the model without effects. most: effects at most. left(fit): evidence [nats] of torques that a fit
    does not explain; a further effect that leaves more than it explains is not what is missing, only something that
    takes its shape. witness: while a model is far off on data that no fit saw, these decide about a further effect, and
    not how small it is beside the largest. joined: fits with one effect from other starts. change(without,
    fit, other): how much a further effect changes the torques beside a look-alike.
    """
    judge = _Judge(search.policy, left, witness, change)
    grown = _grow(search, _Grown(nominal, nominal), most, judge, joined)
    if len(grown.found) == 1 < most and (two := two_for_one(search, grown.found[0], grown.nominal)):
        grown = _grow(search, _Grown(grown.nominal, two[-1][0].fit, two, (), grown.absorbed), most, judge)
    policy = search.policy
    accepted = tuple(ranking[0] for ranking in grown.found)
    equals = tuple(tuple(s.name for s in r[1:] if r[0].net - s.net < policy.equal) for r in grown.found)
    rankings = (*grown.found, grown.last) if grown.last else grown.found
    return Naming(grown.nominal, grown.current, accepted, equals, rankings, grown.absorbed, grown.refused)


@dataclass(frozen=True)
class _Judge:
    """Whether a further effect is one, or only mends the form of those found."""

    policy: DecisionPolicy
    left: Left
    witness: Witness
    change: Change

    def counts(self, found: Sequence[Ranking], gain: float, current: Fit) -> bool:
        """Whether a further effect of some gain [nats] may be one at all. The witness is asked last: it takes time."""
        largest = max((ranking[0].gain for ranking in found), default=0.0)
        return gain >= self.policy.least_share * largest or (gain > self.policy.believed and self.witness.far(current))

    def much_left(self, found: Sequence[Ranking], suspect: Suspect) -> bool:
        """Whether a further effect leaves so much that a better fit of it, or of another, may have been missed."""
        largest = max((ranking[0].gain for ranking in found), default=math.inf)
        return self.left(suspect.fit) > max(suspect.net, self.policy.own_share * largest)

    def takes_shape(self, found: Sequence[Ranking], suspect: Suspect, current: Fit) -> bool:
        """Whether a further effect leaves more than it explains."""
        return bool(found) and self.left(suspect.fit) > suspect.net and not self.confirmed(current, suspect.fit)

    def minor(self, found: Sequence[Ranking], suspect: Suspect) -> bool:
        """Whether a further effect explains too little beside every other one, whatever comes after it."""
        return all(suspect.gain < self.policy.doubtful_share * other.gain for other, *_ in found)

    def mends_form(self, together: Sequence[Ranking], suspect: Suspect, before: Fit) -> bool:
        """Whether a further effect, the last of `together`, is a look-alike of another and hardly changes its torques.
        Data that no fit saw ask for the right form, too, and say nothing about it."""
        *others, (newest, *_) = together
        return any(
            alike(newest.name, other.name) and self.change(before, suspect.fit, other.name) < self.policy.form
            for other, *_ in others
        )

    def slight(self, together: Sequence[Ranking], suspect: Suspect, before: Fit) -> bool:
        """Whether a further effect, the last of `together`, is too small beside the others to be told from their form.

        Not if it is just what was missing, nor if data that no fit saw ask for it."""
        *others, (newest, *_) = together
        policy = self.policy
        if not slight(newest.name, newest.gain, others, policy):
            return False
        enough = not slight(newest.name, newest.gain, others, policy, policy.least_share)
        if enough and self.left(suspect.fit) <= 0.0 and self.left(before) > policy.believed:
            return False
        return not self.confirmed(before, newest.fit)

    def confirmed(self, before: Fit, after: Fit) -> bool:
        """Whether data that no fit saw, from which a model is far off, ask for a further effect."""
        return self.witness.far(before) and self.witness.confirms(before, after)


def _grow(search: Search, so_far: _Grown, most: int, judge: _Judge, joined: Mapping[str, Fit] = NOTHING_YET) -> _Grown:
    """Effects added one at a time, until no further one is believed.

    An effect that leaves more than it explains, or is small beside the others, stays for the time being: where several
    are missing, it may be right, and only the next ones show it. In the end data that no fit saw must ask for it."""
    nominal, current, absorbed = so_far.nominal, so_far.current, so_far.absorbed
    found, last, refused = list(so_far.found), (), None
    doubts: list[_Grown] = []  # before each effect that only data which no fit saw can justify, with what followed it
    for step in range(len(found), most):
        search.progress(f"scoring the library (step {step + 1})")
        names, table = search.suspects(current, step)
        if step == 0:
            absorbed = {name: s.absorbed for name, s in table.items()}
        worth = partial(judge.counts, found, current=current)
        complete = step > 0 and bool(names) and judge.left(current) <= 0.0
        joining = NOTHING_YET if step else joined
        current, last = search.refits(current, names, table, joined=joining, worth=worth, nothing_left=complete)
        if step == 0:
            nominal = current
        if not last or last[0].net < search.policy.believed:
            break
        if not worth(last[0].gain):
            refused = last[0]
            break
        if judge.much_left(found, last[0]) and judge.takes_shape(found, last[0], current):
            current, last = search.refits(current, names, table, thorough=True, worth=worth)
        leaves_more = judge.takes_shape(found, last[0], current)
        if leaves_more and judge.minor(found, last[0]):
            refused = last[0]
            break
        together = search.reconsidered([*found, last], judge.confirmed)
        small = judge.slight(together, last[0], current)
        if judge.mends_form(together, last[0], current) or (small and judge.minor(together[:-1], together[-1][0])):
            refused = last[0]
            break
        if leaves_more or small:
            doubts.append(_Grown(nominal, current, tuple(found), last, absorbed, last[0]))
        found, last, current = together, (), together[-1][0].fit
    for before in doubts:
        if not judge.confirmed(before.current, current):
            return before
    return _Grown(nominal, current, tuple(found), last, absorbed, refused)


def unsettled(naming: Naming, remains: Where, policy: DecisionPolicy) -> Naming:
    """The same with more equals, where what is left goes with the very variable that an effect found depends on. Its
    form is wrong then, and a look-alike of the same variable that explains nearly as much may as well be the name."""
    if not remains.matters:
        return naming
    equals = []
    for found, own, ranking in zip(naming.accepted, naming.equals, naming.rankings, strict=False):
        rivals = [
            s.name
            for s in ranking
            if s.name not in own
            and alike(s.name, found.name)
            and s.gain > policy.as_good * found.gain
            and _acts_on(s.name, remains)
            and _acts_on(found.name, remains)
        ]
        equals.append((*own, *rivals))
    return replace(naming, equals=tuple(equals))


def _acts_on(name: str, remains: Where) -> bool:
    """Whether an effect depends on what the rest goes with, in the same place."""
    effect = EFFECTS[name]
    variables = {_VARIABLES.get(a) for arguments in effect.arguments.values() for a in arguments}
    return remains.variable in variables and str(remains.channel) in effect.place
