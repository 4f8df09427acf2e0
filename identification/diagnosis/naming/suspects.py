"""Suspects: effects that are fitted, the price of their parameters, and when a small one counts beside a large one."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from furuta_gym.plant import EFFECTS, EffectType

from ..policy import DecisionPolicy
from .fits import Fit
from .scores import Score


@dataclass(frozen=True)
class Suspect:
    """A fitted effect. `gain` [nats]: log-likelihood over the model without it; `net`: minus its price."""

    name: str
    gain: float
    net: float
    fit: Fit = field(repr=False)
    score: float = 0.0

    @property
    def type(self) -> EffectType:
        """Its declaration."""
        return EFFECTS[self.name]


Ranking = tuple[Suspect, ...]
"""Suspects of one step, the best first."""


def price(name: str, samples: int, values: Mapping[str, float] | None = None) -> float:
    """What an effect's parameters cost [nats]: half ln N each (the Bayesian information criterion), but 3/2 ln N for a
    frequency and ln N for an instant, which N samples determine so well that more of them can be told apart (Djurić
    1998, "Asymptotic MAP criteria for model selection"). values: of a wider law (default: the plain one)."""
    kind = EFFECTS[name]
    priced = kind.in_play(kind.neutral() if values is None else values)
    return sum(p.information for p in priced) * math.log(samples)


def price_in(fitted: Fit, name: str) -> float:
    """What an effect of a fit costs [nats], of a wider law with its further parameters."""
    effect = fitted.plant.effect(name)
    return price(name, fitted.samples, None if effect is None else effect.parameters)


def alike(one: str, other: str) -> bool:
    """Whether one of two effects is declared to be mistaken for the other."""
    return one in EFFECTS[other].mistaken_for or other in EFFECTS[one].mistaken_for


def periods(fitted: Fit, ripple: str) -> float:
    """How many periods of a ripple the arm passes, in the log where it turns furthest."""
    effect = fitted.plant.effect(ripple)
    assert effect is not None
    a_turn = effect.parameters[effect.type.periods_a_turn]
    return a_turn * max(float(np.ptp(record.y[:, 0])) for record in fitted.records) / (2.0 * math.pi)


def repeats(fitted: Fit, ripple: str, policy: DecisionPolicy) -> bool:
    """Whether the arm passes enough periods of a ripple in a fit to see that it repeats. With fewer, a ripple follows
    nearly any law of the angle, also what is left of a smooth one beside a cubic law."""
    return periods(fitted, ripple) >= policy.periods


def follows_a_law(suspect: Suspect, policy: DecisionPolicy) -> bool:
    """Whether a suspect is a ripple that is not seen to repeat."""
    return bool(suspect.type.periods_a_turn) and not repeats(suspect.fit, suspect.name, policy)


def may_replace(first: Suspect, other: Suspect, policy: DecisionPolicy) -> bool:
    """Whether another suspect may take the place of a name at all. A ripple that is not seen to repeat does not take
    that of a spring or cable: it is one."""
    return not (first.type.of_angle_alone and follows_a_law(other, policy))


def plainer(ranking: Ranking, policy: DecisionPolicy) -> Suspect | None:
    """The spring or cable that explains nearly as much as a ripple at the head of a ranking that is not seen to repeat;
    None without one."""
    first, *others = ranking
    if not follows_a_law(first, policy):
        return None
    near = (s for s in others if s.type.of_angle_alone and s.gain > policy.nearly * first.gain)
    return next(near, None)


def shortlist(table: dict[str, Score], samples: int, least: float, policy: DecisionPolicy) -> list[str]:
    """Effects worth a fit, the best score first.

    An effect is worth it if its score is `least` times its price and near the best one's, or if one of the best is
    mistaken for it (equal to first order, apart in a fit)."""
    promising = {n: s for n, s in table.items() if s.start is not None and s.gain > least * price(n, samples)}
    ranked = sorted(promising, key=lambda name: -promising[name].gain)
    near = [n for n in ranked[: policy.shortlist] if promising[n].gain > policy.near_best_score * _best(promising)]
    names = list(near)
    for name in near[: policy.look_alikes_of]:
        names += [n for n in EFFECTS[name].mistaken_for if n in promising and n not in names]
    return names


def _best(promising: dict[str, Score]) -> float:
    return max(score.gain for score in promising.values())


def slight_beside(
    name: str, gain: float, others: Sequence[Ranking], policy: DecisionPolicy, share: float | None = None
) -> tuple[str, ...]:
    """The others of which an effect may only mend the form: it explains far less than they do, or, of a look-alike, not
    even half.

    No rig has an effect in the library's very words, and what the words miss of a large effect looks like a small
    one of another name, of one that is mistaken for it most of all. share: of the other's gain; default `own_share`.
    """
    least = policy.own_share if share is None else share
    return tuple(
        other.name
        for other, *_ in others
        if gain < (policy.alike_share if alike(name, other.name) else least) * other.gain
    )
