"""What a rig of the bench can hide, and how large it is at strength 1.

Kinds: "library" (the names that a diagnosis may give), "outside" (nothing in that library is it), "absorbed"
(the model's own parameters imitate it), "control" (random torque: no effect to name).

A library effect has two forms. `table` is the equation of the project's table of effects. `bench` is the same cause
with another law, as hardware has it; the right name is the same, its parameters need not be.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .chain import Draft
from .sets import ParameterSet

KINDS = ("library", "outside", "absorbed", "control")
FORMS = ("table", "bench")


class Variation:
    """Signs, places and times of an effect. Number 0 gives the typical one, others are drawn."""

    def __init__(self, number: int, name: str):
        self._rng = np.random.default_rng([number, *name.encode()]) if number else None

    def sign(self) -> float:
        """+1, or either sign."""
        return 1.0 if self._rng is None else float(self._rng.choice([-1.0, 1.0]))

    def near(self, typical: float, low: float, high: float) -> float:
        """`typical`, or uniform in [low, high]."""
        return typical if self._rng is None else float(self._rng.uniform(low, high))

    def one_of(self, *values: float) -> float:
        """The first value, or any."""
        return values[0] if self._rng is None else float(self._rng.choice(values))


Sizes = Callable[[ParameterSet, float, Variation], dict[str, float]]
Build = Callable[[Draft, dict[str, float], bool], None]


@dataclass(frozen=True)
class BenchEffect:
    """One thing that a rig can hide.

    sizes(set, strength, variation) gives the parameters (keys as in `units`); build(draft, parameters, bench_form)
    puts them in. `says` describes it to whoever may know the truth; `other` the `bench` form.
    """

    name: str
    kind: str
    says: str
    units: dict[str, str]
    sizes: Sizes
    build: Build
    other: str = ""

    def forms(self) -> tuple[str, ...]:
        """The forms it has."""
        return FORMS if self.kind == "library" else ("bench",)
