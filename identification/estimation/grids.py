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

from furuta_gym.plant import Plant
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
_MOST = 60  # points: of several effects at once those of the first


def from_grids(
    make: Callable[[Plant, Sequence[Record]], PredictionError],
    plant: Plant,
    records: Sequence[Record],
    names: Container[str],
    known: Container[str],
    pool: Executor | None,
    further: Sequence[Plant] = (),
) -> Plant:
    """The plant with those of its effects that `names` has, where a short fit of everything gets lowest.

    make: the problem of a plant on records, which may be integrated more coarsely than usual. known: "effect.parameter"
    of what is not tried. A frequency starts from its default: `diagnose` finds it in a spectrum. pool: where the fits
    run side by side, each in one thread. further: other plants to start from.
    """
    duration = max(float(r.t[-1]) for r in records)
    grids = {}
    for effect in plant.effects:
        if effect.name not in names:
            continue
        usual = plant.default_effect(effect.name).parameters
        for p in effect.type.parameters:
            points = () if f"{effect.name}.{p.name}" in known else _points(p, usual[p.name], duration)
            if len(points) * math.prod(map(len, grids.values())) <= _MOST and len(points) > 1:
                grids[effect.name, p.name] = points
    if not grids and not further:
        return plant
    thin = [reduced(r, math.inf, THINNED, clock=True) for r in records]
    tried = [_moved(plant, dict(zip(grids, point, strict=True))) for point in itertools.product(*grids.values())]
    tried += further

    def ended(start: Plant) -> tuple[float, Plant]:
        problem = make(start, thin)
        found = minimise(problem, problem.start(), _SHORT, _ROUGH, exact=False)
        return found.value, problem.plant_at(found.z) if math.isfinite(found.value) else start

    return min(mapped(pool, ended, tried), key=lambda end: end[0])[1]


def _points(p: Parameter, usual: float, duration: float) -> tuple[float, ...]:
    """Values worth starting from; none for what has one optimum."""
    if not (p.role == "shape" or p.rough) or p.optional:
        return ()
    return tuple((_TIMES * duration).tolist()) if p.grid == "times" else p.grid_on(usual)


def _moved(plant: Plant, values: dict[tuple[str, str], float]) -> Plant:
    effects = []
    for effect in plant.effects:
        own = {name: value for (of, name), value in values.items() if of == effect.name}
        effects.append(replace(effect, parameters={**effect.parameters, **own}))
    return plant.replace(effects=tuple(effects))
