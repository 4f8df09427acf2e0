"""Start values for friction that remembers the motion, from the logs alone.

A strong hysteresis is friction and stiffness to model (5): a descent from its θ ends far from the rig, wherever it
starts the travel. Along smoothed angles the memory of each travel is known, and its stiffness is linear in the arm's
row: so a regression for each travel says which one fits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from furuta_gym.plant import EFFECTS, Effect, Plant

from ..friction_memory import bristle, stop
from ..logs.log import Log
from .start import SHARPNESS, Array, Motion, PendulumRow, Start, nonnegative, smoothed, starts_with

_TRAVELS = tuple(float(d) for d in np.geomspace(0.004, 1.5, 24))  # rad
_BETTER = 0.98  # of what friction without a memory leaves
_ELEMENTS = {"stop": stop, "bristle": bristle}
_DECLARED = {name: kind.friction_memory for name, kind in EFFECTS.items() if kind.friction_memory}
MEMORIES = tuple(sorted(_DECLARED, key=lambda name: not _DECLARED[name].beside_coulomb))
"""Effects that have such start values, those beside Coulomb friction first."""


@dataclass(frozen=True)
class Remembering:
    """Starts with one effect that remembers, and `left`: the share of the arm's row that it leaves of what friction
    without a memory leaves (rms)."""

    starts: tuple[Start, ...]
    left: float


def remembering(logs: Sequence[Log], plant: Plant, name: str) -> Remembering:
    """Plants with the effect `name`, one of `MEMORIES`, at the travel that a regression finds; `plant` gives the rest.

    There are none where no travel explains more than friction without a memory does.
    """
    m = smoothed(logs)
    row = PendulumRow.of(m)
    soft = np.tanh(SHARPNESS * m.v[:, 0])
    arm = [m.a[:, 0], row.reaction(m), m.v[:, 0]]
    memory = _DECLARED[name]
    along = [_along(m, _ELEMENTS[memory.element], d) for d in _TRAVELS]
    frictions = [[soft, column] if memory.beside_coulomb else [column] for column in along]
    residuals = np.array([_residual([*arm, *columns], m.u) for columns in frictions])
    best = int(np.argmin(residuals))
    plain = _residual([*arm, soft], m.u)
    left = float(residuals[best] / plain) if plain > 0.0 else 1.0
    found = []
    for start, levels in starts_with(m, row, plant, m.u, frictions[best]) if left < _BETTER else ():
        level, travel = float(levels[-1]), _TRAVELS[best]
        if level > 0.0:
            effect = Effect(name, {**plant.default_effect(name).parameters, **memory.start(level, travel)})
            found.append(Start(start.plant.with_effects(effect), start.noise))
    return Remembering(tuple(found), left)


def _residual(columns: Sequence[Array], output: Array) -> float:
    return float(np.linalg.norm(output - np.column_stack(columns) @ nonnegative(columns, output)))


def _along(m: Motion, shape: Callable[[Array, float], Array], travel: float) -> Array:
    """(n,): a memory of the arm's way, slack where each log begins."""
    ends = (*m.first[1:], len(m.u))
    return np.concatenate([shape(m.q[a:b, 0], travel) for a, b in zip(m.first, ends, strict=True)])
