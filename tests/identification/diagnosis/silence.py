"""A `Rest` and a `Witness` that never say anything, and a search for names that asks them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from identification.diagnosis.naming.forward import name_effects
from identification.diagnosis.naming.found import Naming
from identification.diagnosis.naming.search import NOTHING_YET
from identification.diagnosis.policy import MOST_EFFECTS


class NoRest:
    """A `Rest` that never sees anything."""

    def left(self, fitted: Any) -> float:
        return 0.0

    def another_law(self, fitted: Any, name: str) -> float:
        return math.nan


class NoWitness:
    """A `Witness` that never says anything."""

    same_clock = True

    def hears(self, fits: Sequence[Any]) -> None:
        pass

    def far(self, fitted: Any) -> bool:
        return False

    def off(self, fitted: Any) -> bool:
        return False

    def confirms(self, without: Any, fitted: Any) -> bool:
        return False

    def prefers(self, fitted: Any, other: Any) -> bool:
        return False

    def denies(self, without: Any, fitted: Any) -> bool:
        return False

    def excuses(self, without: Any, fitted: Any) -> bool:
        return False


def names_found(
    nominal: Any,
    by: Any,
    most: int = MOST_EFFECTS,
    rest: Any = None,
    witness: Any = None,
    joined: Mapping[str, Any] = NOTHING_YET,
) -> Naming:
    """`name_effects`, where nothing is said of the rest and of held-out data unless given."""
    return name_effects(nominal, by, most, rest or NoRest(), witness or NoWitness(), joined)
