"""Plants tried on one stretch of a log, fast enough to be looked at while a parameter moves.

What does not depend on the plant that is tried is computed once: the record, where the short free runs start, the noise
floor. A plant then costs one pass of its filter, which says where the free runs start, and the free runs themselves.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import Plant

from ..estimation.pool import one_blas_thread
from ..kalman.likelihood import innovation_cost
from ..kalman.noise import fit_noise
from ..kalman.noise_model import RecordNoise
from ..kalman.path import FilterPath, follow
from ..kalman.record import Record
from ..logs.log import Log
from .free_run import Windows, free_run
from .gap import HORIZON, over_floor
from .noise_floor import Floor, noise_floor
from .predicted import SETTLE

LENGTH = 5.0  # s

Array = NDArray[np.float64]


@dataclass(frozen=True)
class WindowPrediction:
    """What a plant predicts of a window.

    angles (N, 2) [rad]: readings as predicted by free runs over the horizon, one after another, each from the
    filter's state at its start; NaN before the first. starts (M,): the samples where they start. rms (2,) [rad]: at
    the horizon, over overlapping runs. ratio_to_floor: as `Gap.ratio_to_floor`; infinite where the filter loses the
    log. log_likelihood: of the window's readings. settled: whether the noise was fitted to this plant, as `validate`
    does; else it is that of the last plant for which it was.
    """

    angles: Array
    starts: NDArray[np.int64]
    rms: Array
    ratio_to_floor: float
    log_likelihood: float
    settled: bool


@dataclass(frozen=True)
class Picture:
    """The angles (N, 2) [rad] of a `WindowPrediction`, before anything is measured. path: the filter's, None where it
    loses the log."""

    angles: Array
    settled: bool
    path: FilterPath | None = field(repr=False)


@dataclass
class PredictionWindow:
    """One stretch of a log, prepared by `of`. log: the stretch. floor (2,) [rad]: of the errors at the horizon."""

    log: Log
    horizon: float
    floor: Array
    _record: Record = field(repr=False)
    _windows: Windows = field(repr=False)
    _chain: Windows = field(repr=False)
    _noise: RecordNoise = field(repr=False)

    @classmethod
    @one_blas_thread
    def of(
        cls, log: Log, plant: Plant, start: float = 0.0, length: float = LENGTH, horizon: float = HORIZON
    ) -> PredictionWindow:
        """The `length` seconds from `start` [s after the log's first stamp], or what the piece of the log there has.

        plant: serves to follow the motion for the noise floor; it may be wrong, see `noise_floor`.
        Raises ValueError where the stretch is too short or the plant's filter loses it.
        """
        if not (np.isfinite(start) and start >= 0 and length > 0):
            raise ValueError(f"a window needs a start ≥ 0 s and a length > 0 s, got {start!r} and {length!r}")
        begin = log.t[0] + start
        around = [piece for piece in log.pieces() if piece.t[-1] > begin]
        if not around:
            raise ValueError(f"{log.source}: lasts {log.duration:.3g} s, so no window starts at {start:g} s")
        part = around[0].slice(max(begin, around[0].t[0]), max(begin, around[0].t[0]) + length)
        record = Record.from_log(part)
        windows = Windows.over(record.t, (horizon,), SETTLE, per_horizon=4)
        T = part.sample_time
        each = max(2, round(horizon / T))
        starts = np.arange(round(SETTLE / T), len(part) - each, each, dtype=np.int64)
        targets = starts[:, None] + np.arange(1, each + 1)
        floor = noise_floor(plant, record, windows)
        return cls(
            log=part,
            horizon=horizon,
            floor=_size(floor),
            _record=record,
            _windows=windows,
            _chain=Windows(starts, targets, tuple(T * (j + 1) for j in range(each))),
            _noise=floor.path.noise,
        )

    @one_blas_thread
    def remeasured(self, plant: Plant) -> PredictionWindow:
        """The same with the floor that this plant measures, as `validate` would; it takes seconds.

        Raises ValueError where the plant's filter loses the log."""
        floor = noise_floor(plant, self._record, self._windows)
        return replace(self, floor=_size(floor), _noise=floor.path.noise)

    def predict(self, plant: Plant, settle: bool = False) -> WindowPrediction:
        """What a plant predicts here. settle: fit the noise to it first, which takes some times as long."""
        return self.measured(self.picture(plant, settle))

    def picture(self, plant: Plant, settle: bool = False) -> Picture:
        """The first half of `predict`: the angles, which are all that a picture needs."""
        try:
            path = fit_noise(plant, self._record).path if settle else follow(plant, self._record, self._noise)
        except ValueError:
            path = None
        angles = np.full((len(self.log), 2), np.nan)
        if path is not None:
            if settle:
                self._noise = path.noise
            ends = self._chain.targets
            angles[ends.ravel()] = (self._record.y[ends] - free_run(path, self._chain)).reshape(-1, 2)
            angles[~np.isfinite(angles)] = np.nan
        return Picture(angles, settle, path)

    def measured(self, picture: Picture) -> WindowPrediction:
        """The second half of `predict`: the error at the horizon and the likelihood."""
        path, starts = picture.path, self._chain.starts
        if path is None:
            return WindowPrediction(picture.angles, starts, np.full(2, np.inf), np.inf, -np.inf, picture.settled)
        errors = free_run(path, self._windows)[:, -1]
        rms = np.sqrt(np.mean(errors**2, axis=0))
        ratio = over_floor(rms, self.floor)
        likelihood = -innovation_cost(path.e, path.S)
        return WindowPrediction(picture.angles, starts, rms, ratio, likelihood, picture.settled)


def _size(floor: Floor) -> Array:
    return np.sqrt(np.mean(floor.variance[:, -1], axis=0))
