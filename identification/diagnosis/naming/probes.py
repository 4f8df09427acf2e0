"""Small trial sizes of an effect, from its declaration: where a search in data starts.

A *cell* fixes the effect's grid shapes (Stribeck speed, ripple order, …) and holds probes, each a full set of parameter
values at a small size. To first order the data's answer to the effect is a combination of the probes' answers; the
weights of the best combination give start values for a refit.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import Effect, EffectType, Parameter, Plant

_SMALL = 0.1  # of the default size, where an effect is linear in its size


@dataclass(frozen=True)
class Cell:
    """Probes of one cell, and what they are in `sizes` (the size parameter each probe moves)."""

    effect: str
    probes: tuple[dict[str, float], ...]
    sizes: tuple[str, ...]
    span: tuple[str, str] | None = None  # (shape parameter, "phase" or "product")

    def start(self, weights: NDArray[np.float64]) -> Effect | None:
        """The effect that `weights` of the probes stand for, or None where a sign forbids it."""
        declared = {p.name: p for p in Effect(self.effect).type.parameters}
        values = dict(self.probes[0])
        if self.span is not None:
            (shape, kind), size = self.span, self.sizes[0]
            unit = self.probes[0][size]
            if kind == "phase":
                values[size], values[shape] = unit * float(np.hypot(*weights)), math.atan2(weights[1], weights[0])
            else:
                total = float(weights.sum())
                values[size] = unit * total
                values[shape] = float(np.clip(weights[1] / total, -10.0, 10.0)) if total != 0.0 else 0.0
        else:
            for probe, size, weight in zip(self.probes, self.sizes, weights, strict=True):
                p = declared[size]
                if math.isinf(p.neutral) or p.integer:
                    if weight < 0.1:
                        return None
                    values[size] = probe[size]
                elif p.grid:  # a secant: valid near the probe's own size only
                    values[size] = probe[size] * float(np.clip(weight, 0.3, 2.0)) if weight > 0 else p.neutral
                else:
                    values[size] = probe[size] * float(weight)
        for name, p in declared.items():
            if p.role == "size" and values[name] < p.lower:
                return None
            values[name] = float(np.clip(values[name], p.lower, p.upper)) if values[name] != p.neutral else p.neutral
        if all(values[p.name] == p.neutral for p in declared.values() if p.role == "size"):
            return None
        return Effect(self.effect, values)


def cells(effect: EffectType, plant: Plant, duration: float, frequencies: NDArray[np.float64]) -> list[Cell]:
    """Cells of an effect on a plant (which scales sizes; its u_max is best the largest command seen) and a log.

    duration [s] places the "times" of a grid; frequencies [Hz] are the ones worth trying.
    """
    default = plant.default_effect(effect.name).parameters
    sizes = [p for p in effect.parameters if p.role == "size"]
    shapes = [p for p in effect.parameters if p.role == "shape"]
    spanned = next((p for p in shapes if p.span), None)
    gridded = [p for p in shapes if not p.span]
    choices = {"times": np.linspace(0.05, 0.95, 37) * duration, "frequencies": frequencies}
    grids = [_grid(p, default[p.name], choices) for p in gridded]
    size_grid = max((len(p.grid) for p in sizes), default=0)
    result = []
    for point in itertools.product(*grids):
        shape_values = {p.name: value for p, value in zip(gridded, point, strict=True)}
        for i in range(max(1, size_grid)):
            result.append(_cell(effect, default, sizes, shape_values, spanned, i))
    return result


def _cell(effect, default, sizes, shape_values, spanned, i) -> Cell:
    probes, moved = [], []
    base = effect.neutral() | shape_values
    for p in sizes:
        value = p.grid[i] * default[p.name] / p.default if p.grid else _SMALL * default[p.name]
        for shape in (0.0, math.pi / 2 if spanned.span == "phase" else 1.0) if spanned else (None,):
            probe = base | {p.name: value}
            if spanned:
                probe[spanned.name] = shape
            probes.append(probe)
            moved.append(p.name)
    return Cell(effect.name, tuple(probes), tuple(moved), (spanned.name, spanned.span) if spanned else None)


def _grid(p: Parameter, default: float, choices: dict[str, NDArray[np.float64]]) -> NDArray[np.float64]:
    if isinstance(p.grid, str):
        return choices[p.grid]
    if not p.grid:
        return np.array([default])
    return np.asarray(p.grid, dtype=float) * (default / p.default if p.default else 1.0)
