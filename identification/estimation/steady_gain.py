"""Whether the command did the same all along a log: a supply that sags, a motor that warms, a driver that switches.

Such a change multiplies all θ by one factor, and a fit gives their mean without a word. The innovations at the fit
still show it: u times a step at some time, or times a ramp, is a torque on the arm that no constant θ gives. It is
regressed on them beside all θ. Friction of the arm that changes looks alike, so that it competes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..discrepancy.basis import Columns, Signals, on_row, parameter_torques
from ..discrepancy.response import answers
from ..kalman.likelihood import whiten
from ..kalman.path import FilterPath
from ..kalman.record import Record
from ..logs.log import Log
from .estimate import Estimate, GainChange
from .model_error import ENOUGH, path_at
from .pool import one_blas_thread
from .start import reduced

Array = NDArray[np.float64]

_SHORTEST = 4.0  # s of a log; less has no two halves that can be compared
_BLOCKS = 12  # of time, whose scatter says how sure a change is
_CERTAIN = 8.0  # standard deviations, by the noise and by the blocks; of other changes of a rig at most 5.2 were seen
_STEPS = (0.2, 0.35, 0.5, 0.65, 0.8)  # of a log, after which the gain may be another
_FRICTION = 0.5  # of what the command explains, which friction that changes may explain as well
_SAME = 1e-7  # of a column's size, below which θ imitates it
_LEAST = 0.04  # of the gain, below which a change is not told
_VISCOUS, _COULOMB = 5, 7  # of θ, the arm's friction


@one_blas_thread
def with_gain_changes(estimate: Estimate, logs: Sequence[Log]) -> Estimate:
    """The estimate with what is told of each fitted log whose command did not do the same all along.

    logs: those that were fitted. As it is, where its method has no likelihood, or a filter loses the log.
    """
    problem, optimum = estimate.problem, estimate.optimum
    if problem is None or optimum is None:
        return estimate
    found = []
    for i, log in enumerate(logs):
        paths = [path_at(problem, optimum.z, _looked_at(r)) for r in problem.records if r.log == i]
        kept = [path for path in paths if path is not None]
        if paths and len(kept) == len(paths) and (change := gain_change(log.source, kept, log.origin)):
            found.append(change)
    return replace(estimate, gain_changes=tuple(found), warnings=(*estimate.warnings, *map(str, found)))


def gain_change(source: str, paths: Sequence[FilterPath], start: float = 0.0) -> GainChange | None:
    """What changed in a log's command, from the paths of its stretches at a fit; None where nothing did for certain.

    start [s]: the stamp that the paths' clock counts from."""
    first, last = float(paths[0].record.t[0]), float(paths[-1].record.t[-1])
    if last - first < _SHORTEST:
        return None

    def shapes(t: Array) -> list[Array]:
        passed = (t - first) / (last - first)
        return [np.where(passed < share, 0.0, 1.0) for share in _STEPS] + [passed]

    found = _regressed(paths, shapes)
    best = int(np.argmax(found.nats[:, 0]))
    change, sure = float(found.change[best, 0]), float(found.sure[best, 0])
    if abs(change) < _LEAST or sure < _CERTAIN or found.nats[:, 1:].max() > _FRICTION * found.nats[best, 0]:
        return None
    before = 1.0 - change * float(found.mean[best])  # as θ stands for the gain's mean over the log
    since = start + first + _STEPS[best] * (last - first) if best < len(_STEPS) else None
    if not before > 0 < before + change:
        return None
    drifts = any(effect.type.changes_gain for effect in paths[0].plant.effects)
    return GainChange(source, (before + change) / before, since, sure, drifts)


@dataclass(frozen=True)
class _Regressed:
    """Of every shape over time (rows), of the command and of the arm's two frictions (columns): change, as a part of
    the mean; how many standard deviations that is; and nats that it gains. mean: of each shape."""

    change: Array
    sure: Array
    nats: Array
    mean: Array


def _regressed(paths: Sequence[FilterPath], shapes: Callable[[Array], list[Array]]) -> _Regressed:
    base, added, left, over_time = [], [], [], []
    for path in paths:
        signals, theta = Signals.of(path), path.plant.theta
        torques = parameter_torques(signals, path.plant)
        changing = [signals.u, theta[_VISCOUS] * torques[:, 0, _VISCOUS], theta[_COULOMB] * torques[:, 0, _COULOMB]]
        over_time.append(np.column_stack(shapes(path.record.t)))
        columns = [shape * torque for shape in over_time[-1].T for torque in changing]
        constant = answers(path, Columns(torque=on_row(0, np.ones_like(signals.u))))
        base.append(np.column_stack([answers(path, Columns(torque=torques)), constant]))
        added.append(answers(path, Columns(torque=on_row(0, *columns))))
        left.append(whiten(path.e, path.S).ravel())
    A, D, w = np.concatenate(base), np.concatenate(added), np.concatenate(left)
    length = np.linalg.norm(A, axis=0)
    kept, values, _ = np.linalg.svd(A / np.where(length > 0, length, 1.0), full_matrices=False)
    kept = kept[:, values > _SAME * values[0]]
    whole = np.sum(D**2, axis=0)
    D, w = (x - kept @ (kept.T @ x) for x in (D, w))
    square = np.sum(D**2, axis=0)
    square = np.where(square > _SAME * whole, square, np.inf)  # else θ imitates it
    change = -(D.T @ w) / square
    scores = D * (w[:, None] + D * change)
    blocks = np.array([part.sum(axis=0) for part in np.array_split(scores, _BLOCKS)])
    std = np.maximum(1.0 / np.sqrt(square), np.sqrt(np.sum(blocks**2, axis=0)) / square)
    nats = 0.5 * change**2 * np.where(np.isfinite(square), square, 0.0)
    sure = np.divide(np.abs(change), std, out=np.zeros_like(std), where=std > 0)
    rows = len(_STEPS) + 1, -1
    return _Regressed(
        change.reshape(rows), sure.reshape(rows), nats.reshape(rows), np.concatenate(over_time).mean(axis=0)
    )


def _looked_at(record: Record) -> Record:
    """A record with at most `ENOUGH` samples over the same time: of a longer one every second or further one."""
    if len(record.t) <= ENOUGH:
        return record
    T = float(np.median(np.diff(record.t)))
    return reduced(record, T * len(record.t), T * math.ceil(len(record.t) / ENOUGH), clock=True)
