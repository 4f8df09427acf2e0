"""How far parameters may be off because the model lacks something, from what the innovations still show of it.

Let the missing torques and reading errors be Φ w, Φ the answers of the innovations to the columns of
`discrepancy.basis.families` and w unknown. The fit then takes part of them for changes of its parameters: with J the
answers to the parameters and Λ the prior's information, the estimate is off by B w, B = (JᵀJ + Λ)⁻¹ JᵀΦ. What J
cannot imitate of Φ w is left in the innovations, and says how large w is. So w is given a prior of variance τ², one for
torques on each row and one for reading errors, chosen by the marginal likelihood of the innovations (type II maximum
likelihood, MacKay 1992), and B E[w wᵀ] Bᵀ is added to the covariance, the expectation given the innovations. It is the
model discrepancy of Kennedy & O'Hagan (2001), with the part that the parameters imitate counted as uncertainty.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..discrepancy.basis import Columns, Family, Knots, Peaks, Signals, families, on_row
from ..discrepancy.dependence import Channel
from ..discrepancy.response import Normal, answers
from ..kalman.coordinates import Coordinate, filled_plant
from ..kalman.likelihood import whiten
from ..kalman.path import FilterPath, follow
from ..kalman.record import Record
from .estimate import Estimate
from .pool import mapped, one_blas_thread, shared_pool
from .prediction_error import PredictionError
from .start import reduced
from .uncertainty import inverse_information

Array = NDArray[np.float64]

ENOUGH = 30_000
"""Samples that are looked at of what a fit leaves of longer logs: here the liveliest."""
_STEP = 1e-5  # of a coordinate, for differences of two paths
_VARIANCES = 10.0 ** np.arange(-3.0, 4.5, 0.5)  # τ² that are tried, for columns whose answers have length one
_SWEEPS = 6
_JITTER = 1e-9
_ARM = (1, 6, 8)  # of θ1 … θ9, what stands in the arm's row alone


@one_blas_thread
def model_error(problem: PredictionError, z: Array) -> Array:
    """Covariance (n, n) that what the model lacks adds to a fit's coordinates at z (n,); zeros where the innovations
    show nothing of it, where a filter loses the log, and for the noise.

    For a right model it is zero more often than not, and small else.
    """
    n = len(z)
    found = np.zeros((n, n))
    own = [i for i, c in enumerate(problem.coordinates) if not c.noise]
    records = _enough(problem.records)
    more = sum(len(r.t) for r in problem.records) / sum(len(r.t) for r in records)
    paths = [path_at(problem, z, record) for record in records]
    normal = None if None in paths else _normal(problem, z, own, [p for p in paths if p is not None])
    if normal is None:
        return found
    equations, groups = normal
    k = len(own)
    prior = problem.priors.at(z)[2] - problem.priors.of_rigid_body(z)
    information = more * equations.gram[:k, :k] + prior[np.ix_(own, own)]
    inverse = inverse_information(information)
    across = equations.gram[:k, k:]
    # of columns with answers of length one, what the parameters cannot imitate
    length = np.sqrt(np.maximum(np.diag(equations.gram)[k:], 1e-300))
    apart = equations.gram[k:, k:] - more * across.T @ inverse @ across
    right = equations.right[k:] - more * across.T @ inverse @ equations.right[:k]
    apart, right = apart / np.outer(length, length), right / length
    variance = likeliest_variances(apart, right, groups)
    if not variance.any():
        return found
    B = more * inverse @ (across / length)
    found[np.ix_(own, own)] = B @ second_moment(apart, right, variance) @ B.T
    return found


def with_model_error(estimate: Estimate) -> Estimate:
    """The estimate with its covariance widened by `model_error`; as it is, where its method has no likelihood."""
    problem, optimum = estimate.problem, estimate.optimum
    if problem is None or optimum is None:
        return estimate
    own = [i for i, c in enumerate(problem.coordinates) if c.of_plant]
    slopes = np.array([problem.coordinates[i].slope(optimum.z[i]) for i in own])
    added = model_error(problem, optimum.z)[np.ix_(own, own)] * np.outer(slopes, slopes)
    return replace(estimate, covariance=estimate.covariance + added, model_error=added)


def likeliest_variances(gram: Array, right: Array, groups: Sequence[str]) -> Array:
    """τ² (m,) of columns, one value for each group, that make a regression's data most likely; 0 is among those
    tried. gram (m, m), right (m,): its normal equations. groups: of each column."""
    which = {group: np.array([g == group for g in groups]) for group in dict.fromkeys(groups)}
    variance, best = np.zeros(len(right)), 0.0
    for _ in range(_SWEEPS):
        before = best
        for members in which.values():
            for tried in (0.0, *_VARIANCES):
                trial = np.where(members, tried, variance)
                evidence = _evidence(gram, right, trial)
                if evidence > best:
                    best, variance = evidence, trial
        if best - before < 1e-3:
            break
    return variance


def second_moment(gram: Array, right: Array, variance: Array) -> Array:
    """E[w wᵀ] (m, m) of a regression's coefficients w, given its data and a prior of these variances."""
    s = np.sqrt(variance)
    precision = np.eye(len(s)) * (1.0 + _JITTER) + s[:, None] * gram * s
    spread = s[:, None] * np.linalg.inv(precision) * s
    mean = spread @ right
    return spread + np.outer(mean, mean)


def _evidence(gram: Array, right: Array, variance: Array) -> float:
    """Log of how much likelier the data are with coefficients of these variances than with none."""
    on = variance > 0
    if not on.any():
        return 0.0
    s = np.sqrt(variance[on])
    M = np.eye(len(s)) * (1.0 + _JITTER) + s[:, None] * gram[np.ix_(on, on)] * s
    try:
        L = np.linalg.cholesky(M)
    except np.linalg.LinAlgError:
        return -math.inf
    x = np.linalg.solve(L, s * right[on])
    return 0.5 * float(x @ x) - float(np.log(np.diag(L)).sum())


def _enough(records: Sequence[Record]) -> list[Record]:
    total = sum(len(r.t) for r in records)
    if total <= ENOUGH:
        return list(records)
    steps = [float(np.median(np.diff(r.t))) for r in records]
    share = ENOUGH / total
    return [reduced(r, T * len(r.t) * share, T, clock=True) for r, T in zip(records, steps, strict=True)]


def path_at(problem: PredictionError, z: Array, record: Record) -> FilterPath | None:
    """The filter's path along a record with a problem's coordinates at z (n,); None where it loses the log."""
    zeros = problem.zeros_at(z).get(record.log, (0.0, 0.0))
    return follow(problem.plant_at(z), record.moved(zeros), problem.noise_at(z).on(record))


def _normal(
    problem: PredictionError, z: Array, own: Sequence[int], paths: Sequence[FilterPath]
) -> tuple[Normal, list[Channel]] | None:
    """Normal equations of the innovations on the coordinates `own`, then on every family's columns, and the group
    of each of these; None where a shifted filter loses a log."""
    signals = [Signals.of(path) for path in paths]
    knots = Knots.of(signals)
    span = min(s.t[0] for s in signals), max(s.t[-1] for s in signals)
    found = []
    groups: list[Channel] = []
    for path, s in zip(paths, signals, strict=True):
        columns = families(s, path.plant, knots, Peaks(), span)  # peaks are picked from the data, at a price
        slopes = _slopes(problem, z, own, path)
        if slopes is None:
            return None
        found.append(Normal.of_columns(path, [slopes, *(answers(path, family) for family in columns)]))
        groups = [_group(f) for f in columns for _ in range(f.size)]
    return Normal.together(found), groups


def _group(family: Family) -> Channel:
    """The row that a family pushes, or sensor; what pushes both counts for the pendulum's, which is the weaker."""
    if family.theta is not None:
        return Channel.ARM if family.theta in _ARM else Channel.PENDULUM
    return Channel.ARM if family.channel is Channel.INPUT else family.channel


def _slopes(problem: PredictionError, z: Array, own: Sequence[int], path: FilterPath) -> Array | None:
    """Whitened answers (2 N, m) of the innovations to the coordinates `own`, with the gains free to follow."""

    def of(i: int) -> Array | None:
        c = problem.coordinates[i]
        if c.zero_of is not None:
            there = np.full(len(path.e), c.scale if c.zero_of == path.record.log else 0.0)
            return answers(path, Columns(misreading=on_row(c.row, there)))
        ends = [_shifted(problem, c, i, z, step, path) for step in (_STEP, -_STEP)]
        (high, above), (low, below) = ends
        if above is None or below is None:
            return None
        return whiten((above.e - below.e)[:, :, None] / (high - low), path.S).reshape(-1, 1)

    found = list(mapped(shared_pool(), of, own))
    kept = [column for column in found if column is not None]
    return np.concatenate(kept, axis=1) if len(kept) == len(found) else None


def _shifted(
    problem: PredictionError, c: Coordinate, i: int, z: Array, step: float, path: FilterPath
) -> tuple[float, FilterPath | None]:
    """Where coordinate i ends within its bounds, and the path of the plant there."""
    there = z.copy()
    there[i] = np.clip(z[i] + step * max(1.0, c.step / _STEP), problem.low[i], problem.high[i])
    try:
        plant = filled_plant(path.plant, problem.coordinates, there)
    except ValueError:  # at the limit of what a rigid body can have
        return float(there[i]), None
    return float(there[i]), follow(plant, path.record, path.noise)
