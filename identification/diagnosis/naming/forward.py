"""Which effects are missing: forward selection, suspects compared by likelihood net of what their parameters cost.

Suspects that the data cannot tell apart are kept as a set of equals.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

from furuta_gym.plant import EFFECTS

from ...kalman.noise_model import Noise
from ..locate.location import Where
from ..policy import DecisionPolicy
from .fits import Fit
from .pairs import two_for_one
from .search import Search
from .suspects import Ranking, Suspect, alike, slight

START_NOISE = Noise((1e-3, 1e-5), (0.5, 0.5))
_VARIABLES = {"u": "command", "q1": "arm angle", "v1": "arm speed", "q2": "pendulum angle", "v2": "pendulum speed"}


@dataclass(frozen=True)
class Naming:
    """Outcome of the search: the model without and with the effects found, and every suspect of each step.

    accepted: the effects found. equals: beside each of them, what cannot be told from it. absorbed: share of each
    effect's response that θ can imitate on these logs. refused: what would explain some more, but too little to be
    told from a wrong form.
    """

    nominal: Fit = field(repr=False)
    final: Fit = field(repr=False)
    accepted: tuple[Suspect, ...]
    equals: tuple[tuple[str, ...], ...]
    rankings: tuple[Ranking, ...]
    absorbed: dict[str, float]
    refused: Suspect | None = None


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


def name_effects(
    nominal: Fit, search: Search, most: int = 3, left: Left = nothing_left, thorough: bool = False
) -> Naming:
    """Forward selection; each effect found is reconsidered when another one joins it, and one alone is compared with
    two.

    nominal: the model without effects. most: effects at most. left(fit): evidence [nats] of torques that a fit
    does not explain; a further effect that leaves more than it explains is not what is missing, only something that
    takes its shape. thorough: try every suspect from several sizes, not the best ones only.
    """
    policy = search.policy
    grown = _grow(search, _Grown(nominal, nominal), most, left, thorough)
    if len(grown.found) == 1 < most and (two := two_for_one(search, grown.found[0], grown.nominal)):
        grown = _grow(search, _Grown(grown.nominal, two[-1][0].fit, two, (), grown.absorbed), most, left, thorough)
    accepted = tuple(ranking[0] for ranking in grown.found)
    equals = tuple(tuple(s.name for s in r[1:] if r[0].net - s.net < policy.equal) for r in grown.found)
    rankings = (*grown.found, grown.last) if grown.last else grown.found
    return Naming(grown.nominal, grown.current, accepted, equals, rankings, grown.absorbed, grown.refused)


def _grow(search: Search, so_far: _Grown, most: int, left: Left, thorough: bool) -> _Grown:
    """Effects added one at a time, until no further one is believed."""
    policy = search.policy
    nominal, current, absorbed = so_far.nominal, so_far.current, so_far.absorbed
    found, last, refused = list(so_far.found), (), None
    for step in range(len(found), most):
        search.progress(f"scoring the library (step {step + 1})")
        names, table = search.suspects(current, step)
        if step == 0:
            absorbed = {name: s.absorbed for name, s in table.items()}
        largest = max((ranking[0].gain for ranking in found), default=0.0)
        least = policy.least_share * largest
        current, last = search.refits(current, names, table, thorough, least=least)
        if step == 0:
            nominal = current
        if not last or last[0].net < policy.believed:
            break
        if last[0].gain < least:
            refused = last[0]
            break
        remains = 0.0
        if found:
            remains = left(last[0].fit)
            if not thorough and remains > max(last[0].net, policy.own_share * largest):
                current, last = search.refits(current, names, table, thorough=True, least=least)
                remains = left(last[0].fit)
            if remains > last[0].net:
                refused = last[0]
                break
        together = search.reconsidered([*found, last])
        newest, others = together[-1][0], together[:-1]
        if slight(newest.name, newest.gain, others, policy) and not (
            # small, but just what was missing
            not slight(newest.name, newest.gain, others, policy, policy.least_share)
            and remains <= 0.0
            and left(current) > policy.believed
        ):
            refused = last[0]
            break
        found, last, current = together, (), together[-1][0].fit
    return _Grown(nominal, current, tuple(found), last, absorbed, refused)


def unsettled(naming: Naming, remains: Where, policy: DecisionPolicy) -> Naming:
    """The same with more equals, where what is left goes with the very variable that an effect found depends on. Its
    form is wrong then, and a look-alike of the same variable that explains nearly as much may as well be the name."""
    if not remains.found:
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
