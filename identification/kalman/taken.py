"""Which readings of a rounded angle a Kalman filter is given, so that what it takes for noise is noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .record import Record

FEWEST = 30
"""Readings below which nothing is said about innovations; a filter takes at least ten a second."""
_HELD = 0.1
"""A count that stays for longer [s] is one reading. Of 0.1, 0.2, 0.3, 0.5 and 1 s this keeps right plants nearest to
their noise floor (decision 43)."""


def taken(record: Record) -> NDArray[np.bool_]:
    """(N, 2) which readings of the two angles a filter takes: of the samples that are `informative`, and of a count
    that stays for longer than `_HELD`, one in the middle of each such time.

    The rounding of a joint that rests is one number. A filter that takes each repetition for news explains the arrival
    and the parting by torques that are not there, and they make up most of the noise floor. The middle, as a count
    begins and ends on the edge of its cell, where rounding is largest.
    """
    every = np.repeat(informative(record)[:, None], 2, axis=1)
    found = every.copy()
    for axis in np.flatnonzero(record.quantum > 0):
        changes = np.flatnonzero(np.diff(record.y[:, axis])) + 1
        begins, ends = np.append(0, changes), np.append(changes, len(record.t))
        long = np.flatnonzero(record.t[ends - 1] - record.t[begins] > _HELD)
        for first, end in zip(begins[long], ends[long], strict=True):
            since = record.t[first:end] - record.t[first]
            parts = round(since[-1] / _HELD)
            middles = (np.arange(parts) + 0.5) * since[-1] / parts
            found[first:end, axis] = False
            found[first + np.searchsorted(since, middles), axis] = True
    return found if found.any(axis=1).sum() >= FEWEST else every


def informative(record: Record) -> NDArray[np.bool_]:
    """(N,) which samples to read, every m-th, so that rounding errors are white, as a Kalman filter takes them to be.

    A fast sampled coarse encoder repeats its count, and with it its error. A filter that takes each repetition for
    news explains it by torques that are not there (at 1 ms and 2048 counts thousandfold). m is the time in which the
    angles move 0.6 counts: on simulated logs of known noise, what keeps its estimate right and loses least.
    """
    t, y = record.t, record.y
    T = float(np.median(np.diff(t)))
    span = max(1, min(round(0.02 / T), len(t) - 1))
    moved = np.mean((y[span:] - y[:-span]) ** 2, axis=0)
    rounding = np.minimum(record.quantum**2 / 12.0, record.variance)
    other = record.variance - rounding  # noise before rounding whitens as motion does
    speed = np.sqrt(np.maximum(moved - 2.0 * record.variance, 0.01 * moved)) / span
    with np.errstate(divide="ignore"):  # an axis at rest repeats its count for ever
        apart = np.divide(record.quantum, np.sqrt(speed**2 + 2.0 * other), out=np.zeros(2), where=record.quantum > 0)
    every = round(np.clip(0.6 * float(apart.max()), 1, max(1, round(0.02 / T))))
    return np.arange(len(t)) % every == 0
