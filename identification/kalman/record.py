"""A log as the Kalman filter takes it: stretches without gaps, and what their encoders are."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from furuta_gym.plant.effects.library import FILTERS
from furuta_gym.sensors import angles_read

from ..logs.checks import LogError, warn
from ..logs.encoders import FEWEST_STEPS, moves_by
from ..logs.log import Log
from .arguments import Readings

SHOWN = 0.25
"""Of the variance that a log's readings show: what is taken as noise at least."""
SHORTEST = 20
"""Samples between two gaps below which a stretch is not used."""

_SAME_STEP = 0.1  # an encoder step that the samples show differs from the declared one beyond this fraction
_LOST = 0.05  # share of a log's samples in short stretches from which it is told
_LEAST_PARABOLA = 5  # readings through which a parabola's first slope is taken; a line where there are fewer
_MOMENT = 1e-3  # s, over which a change of the readings is taken for a velocity
_LEAST = 1e-14  # rad², of a reading's variance


@dataclass(frozen=True)
class Record:
    """t (N,) [s] from the recording's first sample, y (N, 2) readings [rad], u (N, 1) commands, held from their
    sample on.

    quantum (2,): one count of each encoder [rad], 0 where the reading is not rounded. variance (2,): of a reading
    taken as noise, rounding included [rad²]. velocity (2,) and velocity_std: of the first state [rad/s].
    log: number of the log among those of its rig.
    """

    t: NDArray[np.float64]
    y: NDArray[np.float64]
    u: NDArray[np.float64]
    quantum: NDArray[np.float64]
    variance: NDArray[np.float64]
    velocity: NDArray[np.float64]
    velocity_std: float
    log: int = 0

    @property
    def readings(self) -> Readings:
        """As the compiled filters take them."""
        return Readings(self.t, self.y, self.u, self.quantum)

    def moved(self, zeros: ArrayLike) -> Record:
        """The readings less zeros (2,) [rad]."""
        return replace(self, y=self.y - np.asarray(zeros, dtype=float))

    def first_state(
        self, P: NDArray[np.float64], codes: NDArray[np.int64], rows: int, zeros: NDArray[np.float64] | float = 0.0
    ) -> NDArray[np.float64]:
        """States (rows, B) in which encoders of the plants P (n, B), effects `codes`, whose zeros are off by `zeros`
        (2, B) [rad], read the first angles and velocities; what else a state has is zero."""
        read = np.repeat(self.y[0][:, None], P.shape[1], axis=1) - zeros
        later = read + _MOMENT * self.velocity[:, None]
        x = np.zeros((rows, P.shape[1]))
        x[:2] = angles_read(read, P, codes)
        x[2:4] = (angles_read(later, P, codes) - x[:2]) / _MOMENT
        return x

    def first_covariance(self, codes: NDArray[np.int64], rows: int, vague: float = 1.0) -> NDArray[np.float64]:
        """Of that state (rows, rows), for effects `codes`; vague: times the variance of the angles' readings.

        A lag may have any torque of the log when a stretch of it begins: the rig was commanded before, if it was lost
        or left out."""
        C = np.zeros((rows, rows))
        C[[0, 1], [0, 1]] = vague * self.variance
        C[[2, 3], [2, 3]] = self.velocity_std**2
        lagging = [int(first) for number, _, first in codes if number in FILTERS]
        C[lagging, lagging] = np.mean(self.u**2)
        return C

    @property
    def duration(self) -> float:
        """From the first to the last sample [s]."""
        return float(self.t[-1] - self.t[0])

    @classmethod
    def from_log(cls, log: Log) -> Record:
        """Of a log without gaps; counts as declared, or as the samples show them."""
        return _record(log, *_encoders([log])[0])

    @classmethod
    def from_arrays(
        cls,
        t: ArrayLike,
        y: ArrayLike,
        u: ArrayLike,
        variance: ArrayLike,
        quantum: ArrayLike = (0.0, 0.0),
        start: float = 0.0,
    ) -> Record:
        """t (N,), y (N, 2), u (N,), variance and quantum (2,); the first velocity comes from the first readings.

        start [s]: of the first sample, after the log's own."""
        stamps, readings = np.array(t, dtype=float), np.array(y, dtype=float)
        stamps -= stamps[0]
        m = min(len(stamps), max(6, int(np.searchsorted(stamps, 0.02))))
        slope, spread = _first_velocity(stamps[:m], readings[:m], float(np.max(variance)))
        commands = np.array(u, dtype=float).reshape(-1, 1)
        known = np.array(quantum, dtype=float), np.array(variance, dtype=float)
        return cls(stamps + start, readings, commands, *known, slope, 0.1 + spread)


@dataclass(frozen=True)
class Stretch:
    """A part of a log without gaps: the log's index, its samples, and the same as the filter takes them."""

    log: int
    piece: Log
    record: Record

    def parts(self, longest: int, shared: float) -> Iterator[Stretch]:
        """Cut into parts of at most `longest` samples, each of which begins `shared` seconds before the end of the one
        before."""
        t, first = self.record.t, 0
        while True:
            stop = min(first + longest, len(t))
            if len(t) - stop < longest // 4:  # a short rest belongs to the part before it
                stop = len(t)
            yield self if stop - first == len(t) else self._part(slice(first, stop))
            if stop == len(t):
                return
            first = max(int(np.searchsorted(t, t[stop - 1] - shared, side="right")), first + 1)

    def _part(self, samples: slice) -> Stretch:
        whole, piece = self.record, self.piece.taken(samples)
        start = float(whole.t[samples][0])
        part = Record.from_arrays(piece.t, piece.angles, piece.u, whole.variance, whole.quantum, start)
        return Stretch(self.log, piece, replace(part, log=whole.log))


def stretches(logs: Sequence[Log]) -> list[Stretch]:
    """The logs of one rig, cut at the gaps of their clocks; what is shorter than SHORTEST samples is left out.

    Step and noise of the encoders are those of a whole log. An axis that rests in it shows none: then another log
    of the rig tells, or the other encoder. Warns where much is left out; raises LogError where nothing is left.
    """
    found = []
    for i, (log, known) in enumerate(zip(logs, _encoders(logs), strict=True)):
        pieces = [piece for piece in log.pieces() if len(piece) >= SHORTEST]
        kept = sum(map(len, pieces))
        if kept < (1.0 - _LOST) * len(log):
            warn(
                f"{log.source}: {len(log) - kept} of {len(log)} samples stand in stretches of fewer than {SHORTEST} "
                "between gaps of the clock, and are not used. Record without dropping samples where that can be done."
            )
        found += [Stretch(i, piece, replace(_record(piece, *known), log=i)) for piece in pieces]
    if not found:
        raise LogError(
            f"{', '.join(log.source for log in logs)}: no stretch of {SHORTEST} samples without a gap of the clock. "
            "Expected spacings that rarely exceed one and a half times their median; check the time column."
        )
    return found


def _first_velocity(
    t: NDArray[np.float64], y: NDArray[np.float64], variance: float
) -> tuple[NDArray[np.float64], float]:
    """Slope (2,) [rad/s] of a parabola through the readings at the first one, and three of its standard deviations.

    A straight line is off by half the acceleration times the duration, which its own scatter does not show.
    """
    n, duration = len(t), max(float(t[-1]), 1e-6)
    curved = n >= _LEAST_PARABOLA
    spread = math.sqrt((192.0 if curved else 12.0) * variance / n) / duration
    return np.polyfit(t, y, 2 if curved else 1)[-2], 3.0 * spread


def _record(piece: Log, quantum: NDArray[np.float64], variance: NDArray[np.float64]) -> Record:
    return Record.from_arrays(piece.t, piece.angles, piece.u, variance, quantum, piece.begins)


def _encoders(logs: Sequence[Log]) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """quantum and variance (2,) of each log: counts as declared, or as the samples show them; noise not below a
    quarter of what the log shows."""
    known, silent = [], []
    for log in logs:
        declared = [2 * math.pi / c if c > 0 else 0.0 for c in log.encoder_counts or (0.0, 0.0)]
        quantum = np.array([_step(seen, step) for seen, step in zip(log.encoder_steps, declared, strict=True)])
        measured = np.asarray(log.noise_std)
        known.append((quantum, np.maximum(np.maximum(quantum**2 / 12.0, SHOWN * measured**2), _LEAST)))
        changes = np.count_nonzero(np.diff(log.angles, axis=0), axis=0)
        silent.append((quantum == 0.0) & (changes < FEWEST_STEPS))
    told = [(i, a) for a in range(2) for i in range(len(logs)) if not silent[i][a]]
    for i, axis in [(i, a) for i in range(len(logs)) for a in range(2) if silent[i][a]]:
        same, other = [j for j in told if j[1] == axis], [j for j in told if j[1] != axis]
        for k, a in (same or sorted(other, key=lambda j: j[0] != i))[:1]:
            known[i][0][axis] = known[k][0][a]
            known[i][1][axis] = max(known[i][1][axis], known[k][1][a])
    return known


def counts_of(log: Log) -> tuple[float, float]:
    """Counts per revolution of a log's encoders: as declared, or as the samples show them where these contradict; 0
    where neither tells."""

    def of(seen: float | None, count: float) -> float:
        declared = 2 * math.pi / count if count > 0 else 0.0
        step = _step(seen, declared)
        return count if step == declared else float(round(2 * math.pi / step))

    arm, pendulum = map(of, log.encoder_steps, log.encoder_counts or (0.0, 0.0))
    return arm, pendulum


def sharing_counts(logs: Sequence[Log]) -> tuple[Log, ...]:
    """The logs of a rig, with counts for those that are too fast to show them, where other logs show steps by which
    both angles move. Else one encoder would have two models of its readings, by what else is fitted beside a log."""
    counts = [counts_of(log) for log in logs]
    shared = []
    for log, own in zip(logs, counts, strict=True):
        found = list(own)
        for axis in (axis for axis in range(2) if own[axis] <= 0):
            known = (other[axis] for other in counts if other[axis] > 0)
            found[axis] = next((c for c in known if moves_by(log.angles[:, axis], 2 * math.pi / c)), 0.0)
        changed = tuple(found) != own and all(found)  # a log has the counts of both encoders, or of none
        shared.append(replace(log, encoder_counts=(found[0], found[1])) if changed else log)
    return tuple(shared)


def _step(seen: float | None, declared: float) -> float:
    """The encoder's step that counts: the samples' own where it contradicts the declared one."""
    return seen if seen is not None and abs(seen - declared) > _SAME_STEP * seen else declared
