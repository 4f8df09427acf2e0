"""How far a plant predicts logs that it was not fitted to, against what the encoders allow.

The plant runs freely from the Kalman filter's state over a horizon of a few tenths of a second, again and again along
the log, and is compared with the reading at the end. (A free run of the upright plant over seconds diverges for any
model, the true one included, and says nothing.) The floor is what the reading noise alone leaves; where logs repeat
one input, the spread between the repeats is a floor that holds real torque noise too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import Plant

from .coordinates import noise_coordinates
from .filter_path import FilterPath, follow
from .free_run import Windows, free_run
from .likelihood import whiten
from .logs import Log
from .optimise import minimise
from .prediction_error import PredictionError
from .record import Record

HORIZON = 0.2  # s: long enough for a missing torque to show, short against the upright plant's time constant
SETTLE = 0.5  # s that the filter gets before the first prediction
_START_NOISE = np.array([1e-4, 1e-6, 1.0, 1.0])


@dataclass(frozen=True)
class Gap:
    """Prediction errors of a plant on one log or several.

    rms, floor (2,) [rad], fit_percent (2,): at the horizon, for q1 and q2. errors (M, 2) [rad]: reading minus
    prediction of every window, times (M,) [s] their ends, log (M,) the index of their log. counts (2,): one encoder
    count [rad], 0 where unknown. repeats: whether the floor is the spread between repeated runs.
    """

    horizon: float
    rms: NDArray[np.float64]
    floor: NDArray[np.float64]
    fit_percent: NDArray[np.float64]
    whiteness: float
    counts: NDArray[np.float64]
    repeats: bool
    errors: NDArray[np.float64] = field(repr=False)
    times: NDArray[np.float64] = field(repr=False)
    log: NDArray[np.int64] = field(repr=False)

    @property
    def ratio_to_floor(self) -> float:
        """Root mean square over the axes of rms / floor: 1 is as good as the readings allow."""
        return float(np.sqrt(np.mean((self.rms / self.floor) ** 2)))

    def to_dict(self) -> dict[str, Any]:
        numbers = {
            "rms_q1": self.rms[0],
            "rms_q2": self.rms[1],
            "fit_percent_q1": self.fit_percent[0],
            "fit_percent_q2": self.fit_percent[1],
            "horizon_s": self.horizon,
            "noise_floor_q1": self.floor[0],
            "noise_floor_q2": self.floor[1],
            "ratio_to_floor": self.ratio_to_floor,
            "innovation_correlation": self.whiteness,
        }
        floor = "spread of repeated runs" if self.repeats else "reading noise"
        return {"gap": {k: float(v) for k, v in numbers.items()} | {"windows": len(self.errors), "floor": floor}}

    def __str__(self) -> str:
        rows = [f"Prediction {self.horizon:g} s ahead, {len(self.errors)} windows, on logs the plant was not fitted to"]
        for axis, name in enumerate(("q1", "q2")):
            count = self.counts[axis]
            inside = f" = {self.rms[axis] / count:.1f} counts" if count > 0 else ""
            rows.append(
                f"  {name}  rms {1e3 * self.rms[axis]:.3g} mrad{inside}, floor {1e3 * self.floor[axis]:.3g} mrad, "
                f"fit {self.fit_percent[axis]:.1f} %"
            )
        floor = "the spread of the repeated runs" if self.repeats else "the readings' noise alone"
        rows.append(f"  {self.ratio_to_floor:.2f} times what {floor} would leave: {self.verdict}")
        return "\n".join(rows)

    @property
    def verdict(self) -> str:
        """What the ratio to the floor means, and what to do next."""
        ratio = self.ratio_to_floor
        if ratio < 1.2:
            return "nothing of size is missing on these logs"
        if ratio < 3.0:
            return "something small is missing, or the rig has random torques (repeat a run to tell)"
        return "the plant misses something; `furuta diagnose` looks for it"


def validate(plant: Plant, logs: Log | Sequence[Log], horizon: float = HORIZON) -> Gap:
    """The gap of a plant on logs that it was not fitted to.

    The filter that gives the windows' first states has its noise intensities fitted to each log, so that a wrong plant
    starts as near to the readings as it can. horizon [s]. Raises ValueError for logs that are too short or that the
    filter cannot follow with this plant.
    """
    logs = [logs] if isinstance(logs, Log) else list(logs)
    if not logs:
        raise ValueError("validate needs at least one log, got none")
    if not (math.isfinite(horizon) and 0 < horizon <= 5):
        raise ValueError(f"the horizon must lie in (0, 5] s, got {horizon!r}")
    errors, times, index, readings, variances, correlation = [], [], [], [], [], []
    for i, log in enumerate(logs):
        for piece in log.pieces():
            if piece.duration < SETTLE + 2 * horizon:
                continue
            path = filtered(plant, piece)
            windows = Windows.over(path.record.t, (horizon,), SETTLE)
            error = free_run(path, windows)[:, 0]
            if not np.isfinite(error).all():
                raise ValueError(f"{log.source}: the plant's free run over {horizon:g} s leaves all bounds")
            errors.append(error)
            times.append(piece.t[windows.targets[:, 0]])
            readings.append(path.record.y[windows.targets[:, 0]])
            variances.append(np.broadcast_to(path.record.variance, error.shape))
            index.append(np.full(len(error), i))
            correlation.append(_correlation(path))
    if not errors:
        raise ValueError(f"no log is long enough: prediction over {horizon:g} s needs {SETTLE + 2 * horizon:g} s")
    error, reading = np.concatenate(errors), np.concatenate(readings)
    rms = np.sqrt(np.mean(error**2, axis=0))
    spread = _spread(logs, horizon)
    floor = np.sqrt(np.mean(np.concatenate(variances), axis=0)) if spread is None else spread
    centred = reading - reading.mean(axis=0)
    fit_percent = 100.0 * (1.0 - np.linalg.norm(error, axis=0) / np.maximum(np.linalg.norm(centred, axis=0), 1e-12))
    counts = np.asarray(logs[0].encoder_counts or (0.0, 0.0))
    quantum = np.divide(2 * np.pi, counts, out=np.zeros(2), where=counts > 0)
    return Gap(
        horizon, rms, floor, fit_percent, max(correlation), quantum, spread is not None,
        error, np.concatenate(times), np.concatenate(index),
    )  # fmt: skip


def filtered(plant: Plant, log: Log) -> FilterPath:
    """The plant's Kalman filter along a log, its noise intensities fitted to it. ValueError if it loses the log."""
    record = Record.from_log(log)
    problem = PredictionError(plant, [record], noise_coordinates(), _START_NOISE)
    optimum = minimise(problem, problem.start(), iterations=25, tolerance=0.5, exact=False)
    path = None
    if math.isfinite(optimum.value):
        noise = np.exp(optimum.z)
        noise[2:] *= record.variance
        path = follow(plant, record, noise)
    if path is None:
        raise ValueError(
            f"{log.source}: a Kalman filter with this plant cannot follow the log. Check that plant and log share the "
            "unit, the zero of q2 and the signs"
        )
    return path


def _correlation(path: FilterPath) -> float:
    """Largest correlation of a whitened innovation with the one before it, over both axes (0: white)."""
    w = whiten(path.e, path.S)[1:]
    return float(np.max(np.abs(np.sum(w[1:] * w[:-1], axis=0) / np.maximum(np.sum(w * w, axis=0), 1e-300))))


def _spread(logs: Sequence[Log], horizon: float) -> NDArray[np.float64] | None:
    """Rms change over the horizon (2,) [rad] by which runs of one input differ, or None where no input repeats."""
    squares = []
    for a, b in combinations(logs, 2):
        n = min(len(a), len(b))
        if n < 20 or abs(a.sample_time - b.sample_time) > 1e-9 or not np.allclose(a.u[:n], b.u[:n], atol=1e-9):
            continue
        lag = max(1, round(horizon / a.sample_time))
        apart = a.angles[:n] - b.angles[:n]
        # two runs differ by √2 times what one differs from their common course
        squares.append(np.mean((apart[lag:] - apart[:-lag]) ** 2, axis=0) / 2.0)
    return np.sqrt(np.mean(squares, axis=0)) if squares else None


@dataclass(frozen=True)
class ClosedFraction:
    """Share of the squared gap above the floor that one plant closes against another, with a 95 % interval."""

    value: float
    interval: tuple[float, float]


def closed_fraction(before: Gap, after: Gap, seed: int = 0, draws: int = 1000, block: float = 1.0) -> ClosedFraction:
    """(before − after) / (before − floor), squared and over both axes, each in units of its floor.

    The interval is a bootstrap over blocks of `block` seconds, because neighbouring windows overlap. Raises ValueError
    if the two gaps are not of the same logs and horizon.
    """
    if before.errors.shape != after.errors.shape or before.horizon != after.horizon:
        raise ValueError("the two gaps must be of the same logs and the same horizon")
    b = np.sum((before.errors / before.floor) ** 2, axis=1)
    a = np.sum((after.errors / after.floor) ** 2, axis=1)
    _, group = np.unique(np.stack([before.log, np.floor(before.times / block)]), axis=1, return_inverse=True)
    group = group.ravel()
    groups = int(group.max()) + 1
    sums = np.stack([np.bincount(group, x, groups) for x in (b, a, np.full(len(a), 2.0))])
    rng = np.random.default_rng(seed)
    picked = rng.integers(0, groups, (draws, groups))
    with np.errstate(divide="ignore", invalid="ignore"):
        fractions = [_fraction(s) for s in np.moveaxis(sums[:, picked].sum(axis=2), 1, 0)]
    low, high = np.nanquantile(fractions, [0.025, 0.975])
    return ClosedFraction(float(_fraction(sums.sum(axis=1))), (float(low), float(high)))


def _fraction(sums: NDArray[np.float64]) -> float:
    before, after, floor = sums
    return float((before - after) / (before - floor)) if before > floor else math.nan
