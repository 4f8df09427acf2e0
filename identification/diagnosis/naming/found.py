"""What a search for names ends with: the effects found, each among the suspects that it was compared with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import chain

from furuta_gym.plant import EFFECTS, EffectType

from .fits import Fit
from .hung import set_while_hanging
from .suspects import Ranking, Suspect


@dataclass(frozen=True)
class FoundEffect:
    """An effect found, and what may be in its place.

    ranking: the suspects of its step, itself the first. equals: names of those that these logs cannot tell from it.
    same: of the equals, those that predict the same, so that nobody need tell them apart.
    """

    ranking: Ranking
    equals: tuple[str, ...] = ()
    same: tuple[str, ...] = ()

    @property
    def suspect(self) -> Suspect:
        """The effect as it was fitted and compared."""
        return self.ranking[0]

    @property
    def name(self) -> str:
        """Its identifier."""
        return self.suspect.name

    @property
    def type(self) -> EffectType:
        """Its declaration."""
        return self.suspect.type

    @property
    def apart(self) -> tuple[str, ...]:
        """The equals that predict something else."""
        return tuple(name for name in self.equals if name not in self.same)


@dataclass(frozen=True)
class Naming:
    """Outcome of the search: the model without and with the effects found, and every suspect of each step.

    rejected: rankings of the steps of which no suspect stayed. absorbed: share of each effect's response that θ can
    imitate on these logs. refused: what would explain some more, but too little to be told from a wrong form.
    taken_back: what explains some of these logs, but not of data that no fit saw. perhaps_absent: what makes these logs
    likelier, though its size may be zero. laws: which effect only describes another law of which; names that are not
    found, or not any more, count for nothing. went: of an effect found, those found before in whose place it came.
    alone: the model with the best single effect. ended_early: whether the time given ended the search, so that more
    may be missing.
    """

    nominal: Fit = field(repr=False)
    final: Fit = field(repr=False)
    found: tuple[FoundEffect, ...]
    rejected: tuple[Ranking, ...]
    absorbed: dict[str, float]
    refused: Suspect | None = None
    taken_back: tuple[Suspect, ...] = ()
    perhaps_absent: tuple[Suspect, ...] = ()
    laws: Mapping[str, str] = field(default_factory=dict)
    went: Mapping[str, tuple[Suspect, ...]] = field(default_factory=dict)
    alone: Fit | None = field(default=None, repr=False)
    ended_early: bool = False

    @property
    def rankings(self) -> tuple[Ranking, ...]:
        """The suspects of each step, the best first."""
        return tuple(chain((effect.ranking for effect in self.found), self.rejected))

    @property
    def names(self) -> list[str]:
        """Of the effects found."""
        return [effect.name for effect in self.found]

    def follows(self, name: str) -> str | None:
        """The effect found from which another one follows, as a wrong zero of an encoder may; None for any other."""
        of = set_while_hanging(self.final) if EFFECTS[name].wrong_zero == "pendulum" else None
        return of if of in self.names else None

    def describes(self, name: str) -> str | None:
        """The effect found of whose law another one is a part, or from which it follows; None for an effect of its
        own."""
        of = self.laws.get(name)
        return self.follows(name) or (of if of in self.names else None)

    def relation(self, name: str) -> str:
        """What an effect that is none of its own has to do with the one that it `describes`, in words."""
        if (of := self.follows(name)) is not None:
            return f"follows from {of}, as the counter was set while the pendulum hung"
        return f"describes what the law of {self.describes(name)} misses"

    @property
    def own(self) -> tuple[FoundEffect, ...]:
        """The effects found, without what only describes another law of one."""
        return tuple(effect for effect in self.found if self.describes(effect.name) is None)
