"""Small trial sizes of an effect, from its declaration: where a search in data starts.

A *cell* fixes the effect's grid shapes (Stribeck speed, ripple order, …) and holds probes, each a full set of parameter
values at a small size. To first order the data's answer to the effect is a combination of the probes' answers; the
weights of the best combination give start values for a refit.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from furuta_gym.plant import EFFECTS, Effect, EffectType, Parameter, Plant

_SMALL = 0.1  # of the default size, where an effect is linear in its size
_EVALUATIONS = 100  # of a descent to the nearest effect within bounds; one that takes more has gone astray
_CLOSE = 1e-12  # of its tolerances
_KEPT = 0.5  # of what the best weights explain, at least, where bounds forbid them


@dataclass(frozen=True)
class Cell:
    """Probes of one cell, and what they are in `sizes` (the size parameter each probe moves)."""

    effect: str
    probes: tuple[dict[str, float], ...]
    sizes: tuple[str, ...]
    span: tuple[str, str] | None = None  # (shape parameter, "phase" or "product")

    def start(self, weights: NDArray[np.float64], gram: NDArray[np.float64] | None = None) -> Effect | None:
        """The effect that `weights` of the probes stand for, or None where a sign forbids it.

        gram: inner products of the probes' answers, by which an effect with bounds that is declared `linear` comes near
        weights outside of its bounds (default: all alike).
        """
        if EFFECTS[self.effect].linear is not None:
            return _nearest(self, weights, np.eye(len(weights)) if gram is None else gram)
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


def cells(effect: EffectType, plant: Plant, clock: tuple[float, float], frequencies: NDArray[np.float64]) -> list[Cell]:
    """Cells of an effect on a plant (which scales sizes; its u_max is best the largest command seen) and a log.

    clock: the first and last time [s], between which the "times" of a grid lie; frequencies [Hz] are
    the ones worth trying.
    """
    default = plant.default_effect(effect.name).parameters
    sizes = [p for p in effect.parameters if p.role == "size" and not p.optional]
    shapes = [p for p in effect.parameters if p.role == "shape"]
    spanned = next((p for p in shapes if p.span and not p.grid), None)
    gridded = [p for p in shapes if p.grid or not p.span]
    first, last = clock
    choices = {"times": first + np.linspace(0.05, 0.95, 37) * (last - first), "frequencies": frequencies}
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
    if effect.linear is not None:
        return _spanning(effect, default, sizes, base)
    for p in sizes:
        value = p.grid_on(default[p.name])[i] if p.grid else _SMALL * default[p.name]
        for shape in (0.0, math.pi / 2 if spanned.span == "phase" else 1.0) if spanned else (None,):
            probe = base | {p.name: value}
            if spanned:
                probe[spanned.name] = shape
            probes.append(probe)
            moved.append(p.name)
    return Cell(effect.name, tuple(probes), tuple(moved), (spanned.name, spanned.span) if spanned else None)


def _spanning(effect: EffectType, default: Mapping[str, float], sizes: list[Parameter], base: dict) -> Cell:
    """Probes of an effect that is declared `linear`: as many as its coefficients have dimensions."""
    free = [p.name for p in effect.parameters if _free(p)]
    base = base | dict.fromkeys(free, 0.0)
    probes, moved, rows = [], [], []
    for p in sizes:
        for shape in ({}, *({name: 1.0} for name in free)):
            probe = base | {p.name: _SMALL * default[p.name]} | shape
            row = effect.coefficients(probe)
            if np.linalg.matrix_rank([*rows, row]) > len(rows):
                probes.append(probe)
                moved.append(p.name)
                rows.append(row)
    return Cell(effect.name, tuple(probes), tuple(moved))


def _free(p: Parameter) -> bool:
    """Whether a cell leaves a shape open, as the effect's `linear` makes up for it."""
    return p.span == "linear" and not p.grid


def _nearest(cell: Cell, weights: NDArray[np.float64], gram: NDArray[np.float64]) -> Effect | None:
    """The effect within its bounds whose answer is nearest to that of the weights: least squares over its free
    parameters. None where it would explain less than half of what the weights do."""
    effect, base = EFFECTS[cell.effect], cell.probes[0]
    units = {size: probe[size] for size, probe in zip(cell.sizes, cell.probes, strict=True)}
    free = [p for p in effect.parameters if p.name in units or _free(p)]
    scale = np.array([units.get(p.name, 1.0) for p in free])
    low, high = np.array([p.lower for p in free]) / scale, np.array([p.upper for p in free]) / scale
    solved = np.linalg.pinv(np.array([effect.coefficients(probe) for probe in cell.probes]).T)
    values, vectors = np.linalg.eigh(gram / max(float(np.trace(gram)), 1e-300))
    root = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
    wanted = root @ weights

    def misses(x: NDArray[np.float64]) -> NDArray[np.float64]:
        coefficients = effect.coefficients(base | dict(zip((p.name for p in free), x * scale, strict=True)))
        return root @ (solved @ coefficients) - wanted

    size = max(1.0, float(np.abs(weights).max()))
    best, least = None, (1.0 - _KEPT) * float(wanted @ wanted)
    for sides in itertools.product((-1.0, 1.0), repeat=sum(p.name not in units for p in free)):
        side = iter(sides)
        first = np.clip([size if p.name in units else next(side) for p in free], low, high)
        found = least_squares(
            misses, first, bounds=(low, high), method="dogbox", x_scale="jac",
            xtol=_CLOSE, ftol=_CLOSE, gtol=_CLOSE, max_nfev=_EVALUATIONS,
        )  # fmt: skip
        if 2.0 * found.cost < least:
            best, least = found.x, 2.0 * found.cost
    return (
        None
        if best is None
        else Effect(cell.effect, base | dict(zip((p.name for p in free), best * scale, strict=True)))
    )


def _grid(p: Parameter, default: float, choices: dict[str, NDArray[np.float64]]) -> NDArray[np.float64]:
    if isinstance(p.grid, str):
        return choices[p.grid]
    return np.array(p.grid_on(default) or (default,))
