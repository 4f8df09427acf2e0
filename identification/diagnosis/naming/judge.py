"""Whether a further effect is one, or only mends the form of those found: what forward selection asks at each step."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from ..policy import DecisionPolicy
from .fits import Fit
from .suspects import Ranking, Suspect, alike, slight

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


@dataclass(frozen=True)
class Judge:
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
