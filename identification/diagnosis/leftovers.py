"""What the fits of a search leave of its logs: how much, and whether it goes with an effect's own variables. What was
found is kept, as a search asks for the same fit again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from ..estimation.zeros import moved
from ..logs.log import Log
from .locate.locate import left_of
from .locate.seen import Seen
from .naming.fits import Fit
from .policy import DecisionPolicy

_KEPT = 2  # fits whose paths stay in memory: the model so far, and the one that is compared with it


@dataclass
class Leftovers:
    """Answers of a `Judge` from the logs of a search."""

    logs: Sequence[Log]
    policy: DecisionPolicy
    _left: dict[int, tuple[Fit, float]] = field(default_factory=dict, repr=False)
    _laws: dict[tuple[int, str], tuple[Fit, float]] = field(default_factory=dict, repr=False)
    _seen: dict[int, tuple[Fit, Seen]] = field(default_factory=dict, repr=False)

    def left(self, fitted: Fit) -> float:
        """Evidence [nats] of torques that a fit does not explain; 0 of what changes no prediction, or is none."""
        if id(fitted) not in self._left:
            found = left_of(self._of(fitted), self.policy)
            nothing = found.negligible(self.policy) or found.evidence < self.policy.left
            self._left[id(fitted)] = fitted, 0.0 if nothing else found.evidence
        return self._left[id(fitted)][1]

    def another_law(self, fitted: Fit, name: str) -> float:
        """Evidence [nats] that a fit leaves what goes with the variables of an effect's own law."""
        key = id(fitted), name
        if key not in self._laws:
            self._laws[key] = fitted, self._of(fitted).another_law(name)
        return self._laws[key][1]

    def _of(self, fitted: Fit) -> Seen:
        if id(fitted) not in self._seen:
            while len(self._seen) >= _KEPT:
                del self._seen[next(iter(self._seen))]
            self._seen[id(fitted)] = fitted, Seen.of(fitted.plant, moved(self.logs, fitted.zeros), self.policy)
        return self._seen[id(fitted)][1]
