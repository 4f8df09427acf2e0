"""The floors of logs that are predicted: each log's own, or for repeated runs of one input their errors' spread."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..logs.log import Log
from .noise_floor import ALIKE, repeats, spread
from .predicted import Predicted

_SAME = 1e-6  # of the variance that readings leave: no two runs are so much alike

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Floors:
    """each (M, J, 2) [rad²]: of every stretch, as `Predicted.floor`. repeats: whether all are the spread of repeated
    runs. differ: how many times what their noise explains the runs of one command differ, where that is too much for a
    floor; None else."""

    each: tuple[Array, ...]
    repeats: bool
    differ: float | None


def floors_of(logs: Sequence[Log], kept: Sequence[Predicted]) -> Floors:
    """The floors of what was predicted of some logs.

    A run that was stopped somewhat earlier than its repeat is compared with it in the windows that both have; its
    spread is the floor of the others, too.
    """
    by_log = {p.log: p for p in kept}
    own, differ, repeated = [p.floor for p in kept], None, 0
    for group in repeats(logs):
        if any(sum(p.log == i for p in kept) != 1 for i in group):
            continue
        runs = [by_log[i] for i in group]
        shared = slice(_in_common(runs, [logs[i] for i in group]))
        if shared.stop == 0:
            continue
        between = spread([run.errors[shared] for run in runs])
        readings = np.mean([run.readings_floor[shared].mean(axis=0) for run in runs], axis=0)
        if np.all(between < _SAME * readings):  # one recording in two files, or a simulation without noise
            continue
        between = np.maximum(between, readings)  # rounding that runs share is not in their spread
        noise = np.mean([run.floor[shared].mean(axis=0) for run in runs], axis=0)
        if (apart := float(np.sqrt(np.max(between / noise, axis=1)[-1]))) > ALIKE:
            differ = max(differ or 0.0, apart)
            continue
        repeated += len(group)
        own = [
            np.broadcast_to(between, p.errors.shape) if p.log in group else o for p, o in zip(kept, own, strict=True)
        ]
    return Floors(tuple(own), repeated == len(by_log), differ)


def _in_common(runs: Sequence[Predicted], logs: Sequence[Log]) -> int:
    """How many windows runs of these logs have in common, from the first one on; 0 where these end at other times."""
    windows = min(len(run.times) for run in runs)
    ends = np.stack([run.times[:windows] - log.t[0] for run, log in zip(runs, logs, strict=True)])
    return windows if np.ptp(ends, axis=0).max() <= min(log.sample_time for log in logs) else 0
