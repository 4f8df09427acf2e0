"""Whether a further effect is one, or only mends the form of those found: what forward selection asks at each step."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from furuta_gym.plant import EFFECTS

from ..locate.laws import own_variables
from ..policy import DecisionPolicy
from .fits import Fit, added
from .suspects import Ranking, Suspect, alike, follows_a_law, price_in, repeats, slight_beside


class Rest(Protocol):
    """What a fit leaves of the logs that it was fitted to."""

    def left(self, fitted: Fit) -> float:
        """Evidence [nats] of torques that a fit does not explain."""
        ...

    def another_law(self, fitted: Fit, name: str) -> float:
        """The same, of what goes with the variables of an effect's own law; nan where nobody can say."""
        ...


class Witness(Protocol):
    """Data that no fit saw."""

    @property
    def same_clock(self) -> bool:
        """Whether they are a later part of the fitted logs, or nothing."""
        ...

    def hears(self, fits: Sequence[Fit]) -> None:
        """Fits that will be asked about: together they take less time than one by one."""
        ...

    def far(self, fitted: Fit) -> bool:
        """Whether a fit predicts them much worse than noise would, or loses them; False where nobody can tell."""
        ...

    def off(self, fitted: Fit) -> bool:
        """Whether a fit predicts them worse than an adequate plant does, or loses them; False where nobody can tell."""
        ...

    def confirms(self, without: Fit, fitted: Fit) -> bool:
        """Whether a further effect brings the prediction nearer for certain, and by a share that matters."""
        ...

    def prefers(self, fitted: Fit, other: Fit) -> bool:
        """Whether they ask for another fit in the place of one, by more than the fitted logs speak against it."""
        ...

    def denies(self, without: Fit, fitted: Fit) -> bool:
        """Whether they speak against one effect beside others."""
        ...

    def excuses(self, without: Fit, fitted: Fit) -> bool:
        """Whether it says nothing if they speak against it, as the arm is elsewhere there."""
        ...


@dataclass(frozen=True)
class Judge:
    """Whether a further effect is one, or only mends the form of those found."""

    policy: DecisionPolicy
    rest: Rest
    witness: Witness

    def counts(self, found: Sequence[Ranking], gain: float, current: Fit) -> bool:
        """Whether a further effect of some gain [nats] may be one at all. What takes time is asked last."""
        largest = max((ranking[0].gain for ranking in found), default=0.0)
        return gain >= self.policy.least_share * largest or (
            gain > self.policy.believed and (self.foreign(gain, current) or self.witness.far(current))
        )

    def foreign(self, net: float, before: Fit, after: Fit | None = None, beside: Sequence[str] | None = None) -> bool:
        """Whether a further effect explains much that has nothing to do with the laws of those before it, or of some,
        `beside`. net: its gain [nats], less its price. Hardly anything that the model before leaves goes with their
        variables then, or the model `after` leaves it as well: other effects may be missing too."""
        if net < self.policy.much:
            return False
        least = self.policy.foreign * net
        carried = [effect.name for effect in before.plant.effects]
        laws = carried if beside is None or not set(beside) <= set(carried) else beside
        return all(self._taken_up(before, after, name) <= least for name in laws)

    def _taken_up(self, before: Fit, after: Fit | None, name: str) -> float:
        """Evidence [nats] of another law of an effect which a further one may have taken up: all, or what is gone with
        it."""
        of = self.rest.another_law(before, name)
        if after is None or of <= 0.0:
            return of
        return min(of, of - self.rest.another_law(after, name))

    def asked_for(self, without: Fit, fitted: Fit, beside: Sequence[str]) -> bool:
        """Whether an effect found stays that is slight beside some of the others."""
        name = added(fitted, without).name
        net = without.value - fitted.value - price_in(fitted, name)
        return self.foreign(net, without, fitted, beside) or self.confirmed(without, fitted)

    def much_left(self, found: Sequence[Ranking], suspect: Suspect) -> bool:
        """Whether a further effect leaves so much that a better fit of it, or of another, may have been missed."""
        largest = max((ranking[0].gain for ranking in found), default=math.inf)
        return self.rest.left(suspect.fit) > max(suspect.net, self.policy.own_share * largest)

    def takes_shape(self, found: Sequence[Ranking], suspect: Suspect, current: Fit) -> bool:
        """Whether a further effect leaves more than it explains."""
        return bool(found) and self.rest.left(suspect.fit) > suspect.net and not self.confirmed(current, suspect.fit)

    def minor(self, found: Sequence[Ranking], suspect: Suspect) -> bool:
        """Whether a further effect explains too little beside every other one, whatever comes after it."""
        return all(suspect.gain < self.policy.doubtful_share * other.gain for other, *_ in found)

    def law_of(self, together: Sequence[Ranking], before: Fit) -> str | None:
        """The effect before it of which a further one, the last of `together`, only describes another law: it takes up
        what goes with that effect's own variables, to a share of its own gain (`policy`), and no less than what goes
        with its own. So does a ripple that is not seen to repeat, beside another function of the arm's angle. A spring
        or cable is no law of a ripple: no periodic law pulls as they do. Nor is it what else explains all that was
        left: see `_whole_beside`."""
        *others, (newest, *_) = together
        angle = [other.name for other, *_ in others if other.type.of_angle_alone]
        if follows_a_law(newest, self.policy) and angle:
            return angle[0]
        laws = {
            other.name: self._taken_up(before, newest.fit, other.name)
            for other, *_ in others
            if not (newest.type.of_angle_alone and other.type.periods_a_turn)
            and not self._whole_beside(newest, other, before)
        }
        laws = {name: evidence for name, evidence in laws.items() if not math.isnan(evidence)}
        best = max(laws, key=lambda name: laws[name], default=None)
        if best is None or not laws[best] > max(self.policy.left, self.policy.another_law * newest.net):
            return None
        return best if laws[best] >= self._taken_up(before, newest.fit, newest.name) else None

    def _whole_beside(self, newest: Suspect, other: Suspect, before: Fit) -> bool:
        """Whether a further effect is all that was missing beside another one, explains a good share of what that does,
        and is nothing that it is mistaken for. A library law that stands in for what the law of an effect lacks meets
        it closely only where both are declared look-alikes."""
        return (
            not alike(newest.name, other.name)
            and not _changes_law(newest.name, other.name)
            and newest.gain >= self.policy.own_share * other.gain
            and self.rest.left(newest.fit) <= 0.0
            and self.rest.left(before) > self.policy.believed
        )

    def look_alike_law_of(self, together: Sequence[Ranking]) -> str | None:
        """The effect before it of which a further one, the last of `together`, may as well be another law: a look-alike
        in the same variables that explains less than half as much, or a change of what that effect's law is made of, as
        the sharpness r of friction is. Held-out data cannot say which it is, as both predict the same. Not so a ripple
        and what pulls otherwise: see `law_of` and `ripple_of_law`."""
        *others, (newest, *_) = together
        own = own_variables(newest.name)
        for other, *_ in others:
            of = own_variables(other.name)
            rippled = newest.type.periods_a_turn or other.type.periods_a_turn
            if (
                (alike(newest.name, other.name) or _changes_law(newest.name, other.name))
                and (own <= of or of <= own)
                and newest.gain < self.policy.alike_share * other.gain
                and not rippled
            ):
                return other.name
        return None

    def ripple_of_law(self, together: Sequence[Ranking]) -> str | None:
        """The ripple before the last effect of `together` that is not seen to repeat, and so only describes the law of
        that one."""
        *others, (newest, *_) = together
        if newest.type.periods_a_turn or not newest.type.of_angle_alone:
            return None
        ripples = (other.name for other, *_ in others if other.type.periods_a_turn)
        return next((name for name in ripples if not repeats(newest.fit, name, self.policy)), None)

    def slight(self, together: Sequence[Ranking], suspect: Suspect, before: Fit) -> bool:
        """Whether a further effect, the last of `together`, is too small beside the others to be told from their form.

        Not if it is just what was missing, nor if it has nothing to do with their laws or data that no fit saw ask for
        it."""
        *others, (newest, *_) = together
        policy = self.policy
        beside = slight_beside(newest.name, newest.gain, others, policy)
        if not beside:
            return False
        enough = not slight_beside(newest.name, newest.gain, others, policy, policy.least_share)
        if enough and self.rest.left(suspect.fit) <= 0.0 and self.rest.left(before) > policy.believed:
            return False
        new = {e.name for e in newest.fit.plant.effects} - {e.name for e in before.plant.effects}
        after = newest.fit if new == {newest.name} else None  # what was exchanged with it takes up something itself
        return not (self.foreign(newest.net, before, after, beside) or self.confirmed(before, newest.fit))

    def confirmed(self, before: Fit, after: Fit) -> bool:
        """Whether data that no fit saw, from which a model is far off, ask for a further effect. Where that explains
        much of the fitted logs, they are asked as soon as the model predicts them worse than an adequate one."""
        much = before.value - after.value > self.policy.much
        asked = self.witness.far(before) or (much and self.witness.off(before))
        return asked and self.witness.confirms(before, after)


def _changes_law(name: str, other: str) -> bool:
    """Whether an effect changes a value that the law of another one depends on."""
    return any(set(EFFECTS[name].changes) & set(arguments) for arguments in EFFECTS[other].arguments.values())
