"""Where effects start whose parameters have several optima: short fits from each point of the grid they declare.

The time of a step, the angle where a cable comes taut, the deflection at which a stop slips: a descent from one start
ends in the optimum next to it. So an effect that is given by its name alone starts where a short fit gets lowest.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Container, Sequence
from concurrent.futures import Executor
from dataclasses import replace

import numpy as np

from furuta_gym.plant import EFFECTS, Effect, Plant
from furuta_gym.plant.effects.declaration import Parameter

from ..kalman.record import Record
from .long_logs import THINNED
from .optimise import minimise
from .pool import mapped
from .prediction_error import PredictionError
from .start import reduced

_SHORT = 6  # iterations
_ROUGH = 0.5  # nats
_TIMES = np.linspace(0.05, 0.95, 19)  # of a log's duration
_MOST = 60  # points of an effect


def from_grids(
    make: Callable[[Plant, Sequence[Record]], PredictionError],
    plant: Plant,
    records: Sequence[Record],
    names: Container[str],
    known: Container[str],
    pool: Executor | None,
    further: Sequence[Plant] = (),
) -> Plant:
    """The plant with those of its effects that `names` has, where short fits of everything get lowest.

    Several effects join one at a time, the one first that brings most: all at once, each would take another's part.
    make: the problem of a plant, which may lack some effects, on records; it may be integrated more coarsely than
    usual. known: "effect.parameter" of what is not tried. A frequency starts from its default: `diagnose` finds it in a
    spectrum. pool: where the fits run side by side, each in one thread. further: the plant with other start values.
    """
    duration = max(float(r.t[-1]) for r in records)
    waiting = {e.name: at_grid_points(e, plant, known, duration) for e in plant.effects if e.name in names}
    if not further and len(waiting) < 2 and all(len(points) == 1 for points in waiting.values()):
        return plant
    thin = [reduced(r, math.inf, THINNED, clock=True) for r in records]

    def ended(start: Plant, joining: str) -> tuple[float, Plant]:
        problem = make(start, thin)
        held = {f"{joining}.{p.name}" for p in EFFECTS[joining].parameters if _several(p)}
        free = [i for i, c in enumerate(problem.coordinates) if c.name not in held]
        found = minimise(problem, problem.start(), _SHORT, _ROUGH, free, exact=False)
        return found.value, problem.plant_at(found.z) if math.isfinite(found.value) else start

    current = plant.replace(effects=tuple(e for e in plant.effects if e.name not in waiting))
    while waiting:
        starts = [(current.with_effects(effect), name) for name, points in waiting.items() for effect in points]
        for other in further:
            own = [e for e in other.effects if e.name in waiting and e != plant.effect(e.name)]
            starts += [(current.replace(theta=other.theta).with_effects(e), e.name) for e in own]
        ends = list(mapped(pool, lambda start: ended(*start), starts))
        best = min(range(len(starts)), key=lambda i: ends[i][0])
        current = ends[best][1]
        del waiting[starts[best][1]]
    return current


def at_grid_points(effect: Effect, plant: Plant, known: Container[str], duration: float) -> list[Effect]:
    """The effect at every combination of the values worth starting from. plant: for values that are relative to it.
    known: "effect.parameter" of what is not tried. duration [s]: of the longest log."""
    usual = plant.default_effect(effect.name).parameters
    grids: dict[str, tuple[float, ...]] = {}
    for p in effect.type.parameters:
        points = () if f"{effect.name}.{p.name}" in known else _points(p, usual[p.name], duration)
        if len(points) * math.prod(map(len, grids.values())) <= _MOST and len(points) > 1:
            grids[p.name] = points
    return [
        replace(effect, parameters={**effect.parameters, **dict(zip(grids, point, strict=True))})
        for point in itertools.product(*grids.values())
    ]


def _points(p: Parameter, usual: float, duration: float) -> tuple[float, ...]:
    """Values worth starting from; none for what has one optimum."""
    if not _several(p):
        return ()
    return tuple((_TIMES * duration).tolist()) if p.grid == "times" else p.grid_on(usual)


def _several(p: Parameter) -> bool:
    """Whether a fit may have several optima in it."""
    return (p.role == "shape" or p.rough) and not p.optional and bool(p.grid)
