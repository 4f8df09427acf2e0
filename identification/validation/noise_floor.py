"""The noise floor of predictions: what would be left if the plant were right.

From one log: the error of the filtered state at a window's start carried over the horizon, the torque noise on the way
and the noise of the reading at its end, with intensities that no model error inflates (`flexible`). From repeated runs
of one input: what their prediction errors do not share, a floor that asks for no noise model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import Plant

from ..discrepancy.correction import flexible
from ..kalman.noise_model import RecordNoise
from ..kalman.path import FilterPath
from ..kalman.record import Record
from ..logs.log import Log
from .free_run import Windows, floor_covariance

ALIKE = 3.0
"""Spread of runs over the floor of their own noise, beyond which they are not of one rig in one state. Measured: 1.5 to
2.2 of two QUBE experiments in three runs each, 12 where friction rose by 30 % between two runs."""
RESTING = 0.9
"""Share of windows in which an angle's reading changes by one count at most, beyond which the floor is not believed:
where an angle never leaves a few counts, rounding is no noise. Below that share right plants have 0.93 to 1.33 times
the floor on logs without other noise (`experiments.studies.resting`, decision 43)."""
RESTING_SAYS = 8.0
"""Error over such a floor from which a plant misses something all the same."""
_SAME_PLACE = 0.1  # of the range of an angle
_COMMON = 0.9  # of the longer run: one that was stopped earlier than that is no repeat of it
_SAME_TIME = 0.5  # of a sample time: a clock that is read jitters, and every run is predicted at its own stamps

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Floor:
    """Of one log: variance (M, J, 2) [rad²] of the errors of every window and horizon under the right plant, the part
    that comes from readings alone, the plant's own filter path, and the log's noise."""

    variance: Array
    readings_only: Array
    path: FilterPath
    noise: RecordNoise


def noise_floor(plant: Plant, record: Record, windows: Windows) -> Floor:
    """The floor of a record's windows. The plant serves to follow the motion; it may be wrong."""
    found = flexible(plant, record)
    noise = found.path.noise
    quiet = noise.louder(1e-6)
    both = floor_covariance(found.path, windows, noise)[:, :, [0, 2]]
    readings = floor_covariance(found.path, windows, quiet)[:, :, [0, 2]]
    return Floor(both, readings, found.plain.path, noise)


def repeats(logs: Sequence[Log]) -> list[list[int]]:
    """Groups of two or more logs that ran the same command at the same times from the same place, for as long as the
    shorter lasts: a logger that is stopped by hand gives no equal lengths.

    Free decays from different places have their command in common too, but not their motion: what a plant misses in
    them would pass for the spread of repeated runs.
    """
    groups: list[list[int]] = []
    for i, log in enumerate(logs):
        for group in groups:
            other = logs[group[0]]
            if _same_command(log, other) and _same_times(log, other) and _same_start(log, other):
                group.append(i)
                break
        else:
            groups.append([i])
    return [group for group in groups if len(group) > 1]


def _same_command(log: Log, other: Log) -> bool:
    """Whether two logs have nearly all of their time in common, and the same command in it."""
    both = min(len(log), len(other))
    return both >= _COMMON * max(len(log), len(other)) and np.allclose(log.u[:both], other.u[:both], atol=1e-9)


def _same_times(log: Log, other: Log) -> bool:
    """Whether stamps, counted from the first one, differ by no more than half a sample time."""
    both = min(len(log), len(other))
    apart = np.abs((log.t - log.t[0])[:both] - (other.t - other.t[0])[:both])
    return float(apart.max()) <= _SAME_TIME * min(log.sample_time, other.sample_time)


def _same_start(log: Log, other: Log) -> bool:
    """Whether first readings differ by no more than a small part of how far the axes go, or by their noise. Of a free
    decay only by their noise: from elsewhere it swings at another frequency, and soon out of step."""
    place = _SAME_PLACE * np.ptp(log.angles, axis=0) if np.ptp(log.u) > 0 else 0.0
    reach = np.maximum(place, 5.0 * np.asarray(log.noise_std))
    return bool(np.all(np.abs(log.angles[0] - other.angles[0]) <= reach))


def spread(errors: Sequence[Array]) -> Array:
    """Variance (J, 2) of prediction errors (M, J, 2) around what the runs of one input have in common."""
    return np.mean(np.var(np.stack(errors), axis=0, ddof=1), axis=0)
