"""Which row of P, the packed parameters of a plant, holds which parameter: the one place that knows their order.

The compiled kernels of `dynamics` and `integration` read θ and r by position; everything else asks by name.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from .parameters import THETA_NAMES

SHARPNESS_NAMES = ("r1", "r2")
BASE_NAMES = (*THETA_NAMES, *SHARPNESS_NAMES)
"""Of the rows that every plant has."""
N_BASE = len(BASE_NAMES)
"""Rows of P before the effects' parameters."""

THETA_ROWS = slice(BASE_NAMES.index("theta1"), BASE_NAMES.index("theta9") + 1)
FRICTION_ROWS = slice(BASE_NAMES.index("theta6"), BASE_NAMES.index("theta9") + 1)
SHARPNESS_ROWS = slice(BASE_NAMES.index("r1"), BASE_NAMES.index("r2") + 1)
R1, R2 = BASE_NAMES.index("r1"), BASE_NAMES.index("r2")


class NamedEffect(Protocol):
    """What the layout asks of an effect: its name, and a type that knows the names of its parameters."""

    @property
    def name(self) -> str: ...

    @property
    def type(self) -> Any: ...


@dataclass(frozen=True)
class ParameterLayout:
    """Name → row of P: theta1 … theta9, r1, r2, then each effect's parameters as "effect.parameter".

    effects: (name, names of its parameters) of the plant's effects, in the plant's order.
    """

    effects: tuple[tuple[str, tuple[str, ...]], ...] = ()

    @classmethod
    def of(cls, effects: Iterable[NamedEffect]) -> ParameterLayout:
        """Of a plant that carries these effects, in this order."""
        return cls(tuple((effect.name, effect.type.parameter_names) for effect in effects))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Of every row of P, in order."""
        return (*BASE_NAMES, *(f"{effect}.{name}" for effect, own in self.effects for name in own))

    @cached_property
    def _rows(self) -> dict[str, int]:
        return {name: row for row, name in enumerate(self.names)}

    @cached_property
    def _spans(self) -> dict[str, range]:
        spans, first = {}, N_BASE
        for effect, own in self.effects:
            spans[effect] = range(first, first + len(own))
            first += len(own)
        return spans

    @property
    def size(self) -> int:
        """Number of rows."""
        return len(self.names)

    def row(self, name: str) -> int:
        """The row of a parameter: "theta3", "r1", "arm_spring.k". Raises KeyError with the names there are."""
        if name not in self._rows:
            raise KeyError(f"no parameter {name!r} in P; there are {', '.join(self.names)}")
        return self._rows[name]

    def rows(self, name: str) -> tuple[int, ...]:
        """The rows that a name of an estimate stands for: both r1 and r2 for "r", else `row`; none if unknown."""
        if name == "r":
            return R1, R2
        return (self._rows[name],) if name in self._rows else ()

    def rows_of(self, effect: str) -> range:
        """The rows of an effect's parameters. Raises KeyError with the effects there are."""
        if effect not in self._spans:
            raise KeyError(f"no effect {effect!r} in P; there are: {', '.join(self._spans) or 'none'}")
        return self._spans[effect]

    def of_effects(self, p: NDArray[np.float64]) -> dict[str, dict[str, Any]]:
        """{effect: {parameter: p[row]}} of values p (size, …)."""
        return {
            effect: dict(zip(own, (p[row] for row in self._spans[effect]), strict=True)) for effect, own in self.effects
        }
