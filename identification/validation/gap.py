"""How far a plant predicts logs that it was not fitted to, against what noise leaves.

The plant runs freely from its Kalman filter's state over a horizon of a few tenths of a second, again and again along
the log, and is compared with the reading at the end. (A free run of the upright plant over seconds diverges for any
model, the true one included, and says nothing.) The filter's noise intensities are fitted to the log, so that a wrong
plant starts as near to the truth as it can; the floor is computed without trusting the plant (`noise_floor`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import Plant
from furuta_gym.plant.effects.words import number

from ..estimation.pool import mapped, one_blas_thread, shared_pool
from ..estimation.zeros import aligned
from ..kalman.coordinates import Zeros
from ..kalman.noise import fit_noise
from ..kalman.path import FilterPath
from ..kalman.record import Record, Stretch, sharing_counts, stretches
from ..kalman.taken import FEWEST
from ..kalman.whiteness import Innovations, innovations
from ..logs.log import Log, as_logs, check_each_once
from .adequacy import Adequacy, Judgement
from .free_run import PER_HORIZON, Windows
from .noise_floor import RESTING, RESTING_SAYS
from .predicted import SETTLE, Predicted, predicted
from .repeated import floors_of

HORIZON = 0.3  # s: long enough for a missing torque to show, short against the fall of the upright pendulum
_CURVE = (1.0 / 3.0, 2.0 / 3.0, 1.0)  # of the horizon, where errors are kept
_SAME_COUNT = 1e-3  # of a count: encoders whose steps differ by less are alike
_TOGETHER = 60_000  # samples of the logs that are predicted side by side: each keeps some kilobytes

Array = NDArray[np.float64]


def printed_fits(percent: Array) -> tuple[str, str]:
    """The fit of q1 and q2 [%] as it is printed; how far below −100 % says nothing."""
    arm, pendulum = (f"{p:.1f}" if p > -100 else "below -100" for p in percent)
    return arm, pendulum


def over_floor(rms: Array, floor: Array) -> float:
    """Root mean square over the axes of errors over the noise floor, both (2,) [rad]: 1 is as good as the noise
    allows."""
    return float(np.sqrt(np.mean((rms / floor) ** 2)))


@dataclass(frozen=True)
class Gap:
    """Prediction errors of a plant on one log or several.

    rms, floor (2,) [rad] and fit_percent (2,): at the horizon, for q1 and q2. reading_floor (2,): the part of the
    floor that the readings alone leave; the rest is torque noise. curve (J, 5): horizon [s], rms and floor of q1 and
    q2 at shorter horizons. counts (2,): one encoder count [rad], declared or seen in the samples, 0 where unknown or
    not the same in all logs. least_counts (2,): the smallest that is known, 0 where none is.
    repeats: whether all logs were repeated, and the floor is their spread. differ: how many times what their noise
    explains the runs of one command differ, where that is too much for a floor; None else. whiteness: largest
    correlation of an innovation with the one before.
    errors (M, 2) [rad]: reading minus prediction of every window, times (M,) [s] their ends, log (M,) their log.
    floors, reading_floors (M, 2) [rad²]: of every window, whose means are the squares of the two floors.
    surprise (K, 3): log, time [s] and −ln likelihood [nats] of every reading one step ahead, the noise fitted.
    zeros: of the encoders [rad] in each log, estimated before it was predicted.
    still (M, 2): whether q1 and q2 change by at most one count in a window; resting (2,): share of such windows.
    whiteness and tests are of whole logs, also where the windows are of their last parts.
    """

    horizon: float
    rms: Array
    floor: Array
    reading_floor: Array
    fit_percent: Array
    whiteness: float
    counts: Array
    repeats: bool
    curve: Array
    tests: tuple[Innovations, ...] = field(repr=False)
    errors: Array = field(repr=False)
    floors: Array = field(repr=False)
    reading_floors: Array = field(repr=False)
    times: Array = field(repr=False)
    log: NDArray[np.int64] = field(repr=False)
    surprise: Array = field(repr=False)
    zeros: Zeros = field(default_factory=dict, repr=False)
    differ: float | None = None
    resting: Array = field(default_factory=lambda: np.zeros(2), repr=False)
    still: NDArray[np.bool_] = field(default_factory=lambda: np.zeros((0, 2), dtype=bool), repr=False)
    least_counts: Array = field(default_factory=lambda: np.zeros(2), repr=False)

    @property
    def ratio_to_floor(self) -> float:
        """Root mean square over the axes of rms / floor: 1 is as good as the noise allows."""
        return over_floor(self.rms, self.floor)

    @property
    def torque_share(self) -> Array:
        """Share (2,) of the floor's variance that is torque noise fitted to the log; 0 where runs were repeated."""
        return np.zeros(2) if self.repeats else 1.0 - (self.reading_floor / self.floor) ** 2

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
            "reading_floor_q1": self.reading_floor[0],
            "reading_floor_q2": self.reading_floor[1],
            "torque_noise_share_q1": self.torque_share[0],
            "torque_noise_share_q2": self.torque_share[1],
            "innovation_correlation": self.whiteness,
            "resting_share_q1": self.resting[0],
            "resting_share_q2": self.resting[1],
        }
        counts = np.divide(self.rms, self.counts, out=np.full(2, np.nan), where=self.counts > 0)
        more = {
            "rms_counts_q1": float(counts[0]) if self.counts[0] > 0 else None,
            "rms_counts_q2": float(counts[1]) if self.counts[1] > 0 else None,
            "windows": len(self.errors),
            "adequacy": self.judgement.adequacy.value,
            "floor": "spread of repeated runs" if self.repeats else "reading and torque noise",
            "repeats_differ": self.differ,
            "zeros": {f"log {i + 1}": list(zeros) for i, zeros in self.zeros.items()},
            "innovations": [test.to_dict() for test in self.tests],
        }
        return {"gap": {k: float(v) for k, v in numbers.items()} | more}

    def __str__(self) -> str:
        return self.told("on logs the plant was not fitted to")

    def told(self, where: str) -> str:
        """The errors and what they mean, on logs that `where` describes."""
        rows = [f"Prediction {self.horizon:g} s ahead, {len(self.errors)} windows, {where}"]
        for axis, name in enumerate(("q1", "q2")):
            count = self.counts[axis]
            inside = f" = {self.rms[axis] / count:.1f} counts" if count > 0 else ""
            rms, floor, readings = (number(1e3 * float(x[axis])) for x in (self.rms, self.floor, self.reading_floor))
            rows.append(
                f"  {name}  rms {rms} mrad{inside}, floor {floor} mrad "
                f"(readings alone {readings}), fit {self.fits[axis]} %"
            )
        floor = "the noise floor (spread of repeated runs)" if self.repeats else "the noise floor"
        rows.append(f"  {self.ratio_to_floor:.2f} times {floor}: {self.verdict}")
        if self.at_rest and not self.says_little:
            rows.append(f"  {self.at_rest[:1].upper()}{self.at_rest[1:]}.")
        if self.differ is not None:
            rows.append(f"  {self.changed}")
        return "\n".join(rows)

    @property
    def at_rest(self) -> str:
        """Why the floor cannot be trusted, as an angle rests or creeps for long; empty where none does."""
        axis = int(np.argmax(self.resting))
        if self.repeats or self.resting[axis] <= RESTING:
            return ""
        return (
            f"the floor is not to be trusted, as q{axis + 1} rests or creeps: in {100 * self.resting[axis]:.0f} % of "
            "the windows its reading changes by one count at most, and there rounding is no white noise. Take a log "
            "in which both angles move all along"
        )

    @property
    def says_little(self) -> bool:
        """Whether a right plant may have this error over the floor too, as an angle rests."""
        return bool(self.at_rest) and self.ratio_to_floor < RESTING_SAYS

    @property
    def changed(self) -> str:
        """What it means that runs of one command differ by more than their noise; empty where they do not."""
        if self.differ is None:
            return ""
        return (
            f"the runs of one command differ by {self.differ:.2g} times what their noise explains, so the floor is not "
            "their spread: the rig changed between them, or they are of two rigs. Fit and validate each alone"
        )

    @property
    def fits(self) -> tuple[str, str]:
        """The fit of q1 and q2 [%] as it is printed."""
        return printed_fits(self.fit_percent)

    def fit_at(self, floor: Array) -> Array:
        """The fit (2,) [%] of a plant whose errors are `floor` (2,) [rad]; low where an angle hardly moves."""
        return 100.0 - (100.0 - self.fit_percent) * floor / self.rms

    @property
    def judgement(self) -> Judgement:
        """Whether the plant is adequate on these logs."""
        judged = self.by_size
        return replace(judged, adequacy=Adequacy.UNKNOWN) if self.says_little else judged

    def at_the_floor(self, adequate: float) -> bool:
        """Whether the error is that of an adequate plant, one below `adequate` times the floor, also where an angle
        rests and the floor is not to be trusted."""
        judged = Judgement.of(self.ratio_to_floor, float(self.torque_share.max()), adequate)
        return judged.adequacy is Adequacy.ADEQUATE

    @property
    def by_size(self) -> Judgement:
        """The same as `judgement`, but also where an angle rests: a floor that is not to be trusted hides no large
        error."""
        return Judgement.of(self.ratio_to_floor, float(self.torque_share.max()))

    @property
    def verdict(self) -> str:
        """What the ratio to the floor means, and what to do next."""
        if self.says_little:
            return f"this says little: {self.at_rest}"
        judged = self.judgement
        axis = int(np.argmax(self.torque_share))
        if judged.mostly_torque and self.rms[axis] > self.reading_floor[axis]:
            doubt = (
                f"{100 * self.torque_share[axis]:.0f} % of q{axis + 1}'s floor is torque noise fitted to these logs. "
                "Torques that the plant misses raise the floor too: against the readings alone the error is "
                f"{self.rms[axis] / self.reading_floor[axis]:.0f} times too large"
            )
            if judged.adequacy is Adequacy.UNKNOWN:
                return f"this says little: {doubt}. Repeat a run, or let `furuta diagnose` look for what is missing"
            seen = "the plant misses something; `furuta diagnose` looks for it"
            return f"{seen}. The floor is in doubt, so the gap may be larger: {doubt}"
        if judged.adequacy is Adequacy.UNKNOWN:
            return (
                "below the floor, which no plant can be. What this one misses looks like torque noise and has raised "
                "the floor. Compare with a better plant, or repeat a run"
            )
        if judged.adequacy is Adequacy.ADEQUATE:
            return "nothing of size is missing on these logs"
        if judged.adequacy is Adequacy.SMALL:
            return "something small is missing; `furuta diagnose` looks for it"
        return "the plant misses something; `furuta diagnose` looks for it"


@one_blas_thread
def validate(plant: Plant | str, logs: Log | Sequence[Log], horizon: float = HORIZON, *, own_zeros: bool = True) -> Gap:
    """The gap of a plant on logs that it was not fitted to, at a horizon [s].

    plant: a `Plant`, a plant file or a known set. own_zeros: estimate the zeros of the encoders in each log first, as
    logs of one rig need not count from the same place; off for logs that the plant was fitted to. Of logs that repeat
    one command the floor is their spread, unless they differ by more than `ALIKE` times their noise. Raises TypeError
    for what is no `Log`, and ValueError for logs that are too short or given twice, whose command is in another unit
    than the plant's, or that the filter cannot follow with this plant.
    """
    plant, logs = Plant.resolve(plant), list(sharing_counts(as_logs(logs)))
    if not logs:
        raise ValueError("validate needs at least one log, got none")
    check_each_once(logs, "the noise floor would be that of a repeated run without noise: zero")
    for log in logs:
        log.check_unit(plant.unit)
    if not (math.isfinite(horizon) and 0 < horizon <= 5):
        raise ValueError(f"the horizon must lie in (0, 5] s, got {horizon!r}")
    zeros: Zeros = {}
    if own_zeros:
        found = aligned(plant, logs)
        logs, zeros = list(found.logs), found.zeros
    horizons = tuple(f * horizon for f in _CURVE)
    long = [stretch for stretch in stretches(logs) if _long_enough(stretch, horizons)]
    kept = _every(lambda stretch: predicted(plant, stretch, horizons), long)
    if not kept:
        raise ValueError(
            f"no log is long enough: prediction over {horizon:g} s needs {SETTLE + 2 * horizon:g} s without a gap of "
            f"the clock, in which {2 * PER_HORIZON} samples lie after the first {SETTLE:g} s and before the last "
            f"{horizon:g} s"
        )
    error, reading = (np.concatenate([getattr(p, name) for p in kept]) for name in ("errors", "readings"))
    rms = np.sqrt(np.mean(error**2, axis=0))
    own = floors_of(logs, kept)
    floors = np.concatenate(own.each)
    only = np.concatenate([p.readings_floor for p in kept])[:, -1]
    floor = np.sqrt(np.mean(floors, axis=0))
    log = np.concatenate([np.full(len(p.errors), p.log) for p in kept])
    tests = tuple(innovations(p.whitened) for p in kept)
    still = np.concatenate([p.still for p in kept])
    steps = np.stack([stretch.record.quantum for stretch in long])
    return Gap(
        horizon=horizon,
        rms=rms[-1],
        floor=floor[-1],
        reading_floor=np.minimum(np.sqrt(np.mean(only, axis=0)), floor[-1]),
        fit_percent=fit_percent(rms[-1], reading, log),
        whiteness=max(float(np.abs(test.correlation[0]).max()) for test in tests),
        counts=np.where(np.ptp(steps, axis=0) <= _SAME_COUNT * steps[0], steps[0], 0.0),
        repeats=own.repeats,
        curve=np.column_stack([[f * horizon for f in _CURVE], rms, floor]),
        tests=tests,
        errors=error[:, -1],
        floors=floors[:, -1],
        reading_floors=only,
        times=np.concatenate([p.times for p in kept]),
        log=log,
        surprise=np.concatenate([p.surprise for p in kept]),
        zeros=dict(zeros),
        differ=own.differ,
        resting=still.mean(axis=0),
        still=still,
        least_counts=_smallest(steps),
    )


def _every(work: Callable[[Stretch], Predicted], stretches: Sequence[Stretch]) -> list[Predicted]:
    """work(stretch) of each, side by side as far as memory allows."""
    done: list[Predicted] = []
    while rest := stretches[len(done) :]:
        ends = np.cumsum([len(stretch.record.t) for stretch in rest])
        together = max(1, int(np.searchsorted(ends, _TOGETHER, side="right")))
        done += mapped(shared_pool(), work, rest[:together])
    return done


def _smallest(steps: Array) -> Array:
    """Of encoder steps (L, 2) [rad] the smallest on each axis; those of 0 are unknown, and 0 where all are."""
    least = np.where(steps > 0, steps, np.inf).min(axis=0)
    return np.where(np.isfinite(least), least, 0.0)


def fit_percent(rms: Array, readings: Array, log: NDArray[np.int_]) -> Array:
    """(2,) [%]: 100 where an error rms (2,) is nothing beside the motion of readings (M, 2) about the mean of their own
    log (M,). About one mean of all logs, hanging and upright runs would leave any error small."""
    own = np.zeros_like(readings)
    for i in np.unique(log):
        own[log == i] = readings[log == i].mean(axis=0)
    motion = np.sqrt(np.mean((readings - own) ** 2, axis=0))
    return 100.0 * (1.0 - rms / np.maximum(motion, 1e-12))


def _long_enough(stretch: Stretch, horizons: tuple[float, ...]) -> bool:
    """Whether a stretch can be predicted over horizons [s], and its innovations be tested."""
    record = stretch.record
    lasts = record.duration >= SETTLE + 2 * max(horizons) and len(stretch.piece) >= FEWEST
    return lasts and Windows.fit_into(record.t, horizons, SETTLE)


def filtered(plant: Plant, log: Log) -> FilterPath:
    """The plant's Kalman filter along a log, its noise intensities fitted to it. ValueError if it loses the log."""
    try:
        return fit_noise(plant, Record.from_log(log)).path
    except ValueError as error:
        raise ValueError(f"{log.source}: {error}") from error
