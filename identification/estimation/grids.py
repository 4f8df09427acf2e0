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

from ..discrepancy.correction import spectral_peaks
from ..kalman.path import follow
from ..kalman.record import Record
from .long_logs import THINNED
from .optimise import minimise
from .pool import mapped
from .prediction_error import PredictionError
from .start import reduced

_SHORT = 12  # iterations; after six, points are still ordered by their way to the optimum of everything else
_ROUGH = 0.5  # nats
_TIMES = np.linspace(0.05, 0.95, 19)  # of a log's duration
_BETWEEN = np.array([-0.8, -0.6, -0.4, -0.2, 0.2, 0.4, 0.6, 0.8])  # of a distance, where a better one is looked for
_CLOSER = (0.05, 0.01, 0.002)  # distances of such points, of a log's duration: of the grid's, and two finer ones
_FREQUENCIES = 4  # peaks of the spectrum that are tried
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
    usual. known: "effect.parameter" of what is not tried. A frequency starts from the largest peaks in the spectrum of
    what the plant leaves without the effects. pool: where the fits run side by side, each in one thread. further: the
    plant with other start values.
    """
    clock = clock_of(records)
    thin = [reduced(r, math.inf, THINNED, clock=True) for r in records]
    given = [e for e in plant.effects if e.name in names]
    hertz: tuple[float, ...] = ()
    if any(p.repeats and f"{e.name}.{p.name}" not in known for e in given for p in e.type.parameters):
        hertz = _spectrum(make, plant.without(*(e.name for e in given)), thin)
    waiting = {e.name: at_grid_points(e, plant, known, clock, hertz) for e in given}
    if not further and len(waiting) < 2 and all(len(points) == 1 for points in waiting.values()):
        return plant

    def ended(start: Plant, joining: str) -> tuple[float, Plant]:
        problem = make(start, thin)
        held = {f"{joining}.{p.name}" for p in EFFECTS[joining].parameters if _several(p)}
        free = [i for i, c in enumerate(problem.coordinates) if c.name not in held]
        found = minimise(problem, problem.start(), _SHORT, _ROUGH, free, exact=False)
        return found.value, problem.plant_at(found.z) if math.isfinite(found.value) else start

    current = plant.without(*waiting)
    while waiting:
        starts = [(current.with_effects(effect), name) for name, points in waiting.items() for effect in points]
        for other in further:
            own = [e for e in other.effects if e.name in waiting and e != plant.effect(e.name)]
            starts += [(current.replace(theta=other.theta).with_effects(e), e.name) for e in own]
        ends = list(mapped(pool, lambda start: ended(*start), starts))
        best = min(range(len(starts)), key=lambda i: ends[i][0])
        value, current = ends[best]
        name = starts[best][1]
        for apart in _CLOSER:
            finer = between(current, name, known, clock[1], apart * (clock[1] - clock[0]))
            closer = list(mapped(pool, lambda plant, name=name: ended(plant, name), finer))
            value, current = min([(value, current), *closer], key=lambda end: end[0])
        del waiting[name]
    return current


def between(plant: Plant, name: str, known: Container[str], duration: float, apart: float) -> list[Plant]:
    """The plant with the time of an effect's step at points less than `apart` [s] from where it is; none for an effect
    without such a time."""
    effect = plant.effect(name)
    assert effect is not None
    times = [p.name for p in effect.type.parameters if p.instant and f"{name}.{p.name}" not in known]
    found = []
    for key in times:
        for t in effect.parameters[key] + _BETWEEN * apart:
            if 0.0 < t < duration:
                found.append(plant.with_effects(replace(effect, parameters={**effect.parameters, key: float(t)})))
    return found


def _spectrum(
    make: Callable[[Plant, Sequence[Record]], PredictionError], plant: Plant, records: Sequence[Record]
) -> tuple[float, ...]:
    """The frequencies [Hz] that stand out of what a fit of the plant leaves on the longest record."""
    problem = make(plant, records)
    z = minimise(problem, problem.start(), _SHORT, _ROUGH, exact=False).z
    record = max(problem.records, key=lambda r: len(r.t))
    zeros = problem.zeros_at(z).get(record.log, (0.0, 0.0))
    path = follow(problem.plant_at(z), record.moved(zeros), problem.noise_at(z).on(record))
    return () if path is None else spectral_peaks(path, _FREQUENCIES).hertz


def clock_of(records: Sequence[Record]) -> tuple[float, float]:
    """The first and the last time [s] of records, on their recordings' clocks."""
    return min(float(r.t[0]) for r in records), max(float(r.t[-1]) for r in records)


def at_grid_points(
    effect: Effect, plant: Plant, known: Container[str], clock: tuple[float, float], hertz: Sequence[float] = ()
) -> list[Effect]:
    """The effect at every combination of the values worth starting from. plant: for values that are relative to it.
    known: "effect.parameter" of what is not tried. clock: of the records (see `clock_of`). hertz: frequencies to
    try; its own where there are none."""
    usual = plant.default_effect(effect.name).parameters
    grids: dict[str, tuple[float, ...]] = {}
    for p in effect.type.parameters:
        points = () if f"{effect.name}.{p.name}" in known else _points(p, usual[p.name], clock, hertz)
        if len(points) * math.prod(map(len, grids.values())) <= _MOST and len(points) > 1:
            grids[p.name] = points
    return [
        replace(effect, parameters={**effect.parameters, **dict(zip(grids, point, strict=True))})
        for point in itertools.product(*grids.values())
    ]


def _points(p: Parameter, usual: float, clock: tuple[float, float], hertz: Sequence[float]) -> tuple[float, ...]:
    """Values worth starting from; none for what has one optimum."""
    if not _several(p):
        return ()
    if p.repeats:
        return tuple(hertz)
    first, last = clock
    return tuple((first + _TIMES * (last - first)).tolist()) if p.instant else p.grid_on(usual)


def _several(p: Parameter) -> bool:
    """Whether a fit may have several optima in it."""
    return (p.role == "shape" or p.rough) and not p.optional and bool(p.grid)
