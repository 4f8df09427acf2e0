"""Long logs: the liveliest part of a fit's records shows at a fraction of the cost where its minimum is."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .optimise import minimise
from .prediction_error import PredictionError
from .start import reduced

LONG = 100_000
"""Samples beyond which a descent starts on parts of them."""
PARTS = (10_000, 60_000)
"""Samples of those parts. The first is enough to tell a stalled fit from its optimum, by hundreds of nats."""
THINNED = 8e-3
"""Sample time [s] that is enough for the same on shorter logs."""


def part_of(problem: PredictionError, samples: int | None = None) -> PredictionError | None:
    """The problem on the liveliest `samples` (default: the first of `PARTS`) of its records; None where it has no more
    than `LONG`."""
    samples = PARTS[0] if samples is None else samples
    total = sum(len(record.t) for record in problem.records)
    if total <= LONG:
        return None
    part = []
    for record in problem.records:
        T = float(np.median(np.diff(record.t)))
        part.append(reduced(record, T * len(record.t) * samples / total, T, clock=True))
    return problem.on(part)


def glimpse_of(problem: PredictionError) -> PredictionError | None:
    """A problem that costs a part of this one and has its minima in about the same places: of long logs the liveliest
    part, of others readings every `THINNED` seconds; None where neither saves anything."""
    if (part := part_of(problem)) is not None:
        return part
    thin = [reduced(r, math.inf, THINNED, clock=True) for r in problem.records]
    pairs = zip(thin, problem.records, strict=True)
    return problem.on(thin) if all(2 * len(short.t) <= len(r.t) + 1 for short, r in pairs) else None


def begin(problem: PredictionError, iterations: int) -> NDArray[np.float64]:
    """Where to start the descent: the problem's own start, on a long log the minimum of its parts."""
    z = problem.start()
    for samples in PARTS:
        if (part := part_of(problem, samples)) is not None:
            z = minimise(part, z, iterations, exact=False).z
    return z
