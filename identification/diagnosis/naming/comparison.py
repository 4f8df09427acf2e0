"""Where the comparison of suspects in one step of a search stands."""

from __future__ import annotations

from dataclasses import dataclass, field

from furuta_gym.plant import Effect

from ..policy import DecisionPolicy
from .fits import Effort, Fit, added
from .multistart import rivals_of
from .scores import Score
from .suspects import alike


@dataclass
class Comparison:
    """Where the comparison of suspects stands: the best fit of each, and what has been done with it.

    suggested: starts from the scores. table: all scores. current: the model without any. held: a fit that takes part
    as it is. effort: of a fit to the end. led: effects that were the best, and how well they did. resized: effects
    tried from other sizes. finished: fits to the end.
    """

    fits: dict[str, Fit]
    suggested: dict[str, Effect]
    table: dict[str, Score]
    current: Fit
    held: Fit | None
    effort: Effort
    led: dict[str, float] = field(default_factory=dict)
    resized: set[str] = field(default_factory=set)
    finished: dict[str, Fit] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """The best suspect."""
        return min(self.fits, key=lambda name: self.fits[name].value)

    @property
    def best(self) -> Fit:
        return self.fits[self.name]

    def rivals(self, policy: DecisionPolicy) -> dict[str, Effect]:
        """What might be mistaken for the best, each with where it starts: fitted effects as they are, suggested ones
        that have not been fitted, and declared look-alikes that no score suggested as their scores or defaults have
        them."""
        best = self.name
        found = {n: added(self.fits[n], self.current) for n in rivals_of(best, self.fits, policy) if n != best}
        found |= {n: start for n, start in self.suggested.items() if n not in self.fits}
        for name in self.table:
            if alike(name, best) and name not in self.fits and name not in found:
                found[name] = self.table[name].start or self.current.plant.default_effect(name)
        return found
