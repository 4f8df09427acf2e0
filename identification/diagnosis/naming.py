"""Which effect is missing: a forward search, its suspects compared by likelihood with what each costs.

Suspects that the data cannot tell apart are kept as a set of equals.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from furuta_gym.plant import EFFECTS, Plant

from .candidates import Fit
from .race import alike
from .search import OWN_SHARE, THRESHOLD, Ranking, Search, Suspect, slight
from .where import Where

EQUALS = 5.0  # nats: suspects this close to the best cannot be told from it
START_NOISE = np.array([1e-3, 1e-5, 0.5, 0.5])
_AS_GOOD = 0.9  # of the leader's gain, where the form of both is wrong
_VARIABLES = {"u": "command", "q1": "arm angle", "v1": "arm speed", "q2": "pendulum angle", "v2": "pendulum speed"}
_HOPELESS = 0.5  # of a further effect's share: what explains less is not looked at any closer


@dataclass(frozen=True)
class Naming:
    """Outcome of the search: the model without and with the effects found, and every suspect of each step."""

    nominal: Fit = field(repr=False)
    final: Fit = field(repr=False)
    accepted: tuple[Suspect, ...]
    equals: tuple[tuple[str, ...], ...]  # beside each accepted effect, what cannot be told from it
    rankings: tuple[Ranking, ...]
    absorbed: dict[str, float]  # share of each effect's answer that θ can imitate on these logs
    refused: Suspect | None = None  # what would explain some more, but too little to be told from a wrong form


def name_effects(
    nominal: Fit,
    anchor: Plant,
    most: int = 3,
    only: Sequence[str] | None = None,
    progress: Callable[[str], None] | None = None,
    left: Callable[[Plant], float] = lambda plant: 0.0,
    thorough: bool = False,
) -> Naming:
    """Forward search; each effect found is reconsidered when another one joins it.

    anchor: plant for the weak prior (see `anchored`). most: effects at most. only: restrict the library.
    progress(text) is told each step. left(plant): evidence [nats] of torques that a plant does not explain; a further
    effect that leaves more than it explains is not what is missing, only something that takes its shape. thorough: try
    every suspect from several sizes, not the leading ones only.
    """
    tell = progress or (lambda text: None)
    search = Search(anchor, only, tell)
    current, found, last = nominal, [], ()
    absorbed: dict[str, float] = {}
    refused: Suspect | None = None
    for step in range(most):
        tell(f"scoring the library (step {step + 1})")
        names, table = search.suspects(current, len(found))
        if step == 0:
            absorbed = {name: s.absorbed for name, s in table.items()}
        least = _HOPELESS * OWN_SHARE * max((ranking[0].gain for ranking in found), default=0.0)
        current, last = search.refits(current, names, table, thorough, least=least)
        if step == 0:
            nominal = current
        if not last or last[0].net < THRESHOLD:
            break
        if last[0].gain < least:
            refused = last[0]
            break
        if found and (remains := left(last[0].fit.plant)) > last[0].net:
            if not thorough and remains > OWN_SHARE * max(ranking[0].gain for ranking in found):
                current, last = search.refits(current, names, table, thorough=True, least=least)
                remains = left(last[0].fit.plant)
            if remains > last[0].net:
                refused = last[0]
                break
        together = search.reconsidered([*found, last])
        if slight(together[-1][0].name, together[-1][0].gain, together[:-1]):
            refused = last[0]
            break
        found, last, current = together, (), together[-1][0].fit
    accepted = tuple(ranking[0] for ranking in found)
    equals = tuple(tuple(s.name for s in r[1:] if r[0].net - s.net < EQUALS) for r in found)
    rankings = (*found, last) if last else tuple(found)
    return Naming(nominal, current, accepted, equals, rankings, absorbed, refused)


def unsettled(naming: Naming, rest: Where) -> Naming:
    """The same with more equals, where what is left goes with the very variable that an effect found depends on. Its
    form is wrong then, and a look-alike of the same variable that explains nearly as much may as well be the name."""
    if not rest.found:
        return naming
    equals = []
    for found, own, ranking in zip(naming.accepted, naming.equals, naming.rankings, strict=False):
        rivals = [
            s.name
            for s in ranking
            if s.name not in own
            and alike(s.name, found.name)
            and s.gain > _AS_GOOD * found.gain
            and _acts_on(s.name, rest)
            and _acts_on(found.name, rest)
        ]
        equals.append((*own, *rivals))
    return replace(naming, equals=tuple(equals))


def _acts_on(name: str, rest: Where) -> bool:
    """Whether an effect depends on what the rest goes with, in the same place."""
    effect = EFFECTS[name]
    variables = {_VARIABLES.get(a) for arguments in effect.arguments.values() for a in arguments}
    return rest.variable in variables and str(rest.channel) in effect.place
