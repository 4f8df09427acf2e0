"""Start values from the log alone: smoothed regression for the ratios, a short race for what it cannot tell.

The pendulum's row of (5) over θ4 has no scale, so a regression on smoothed derivatives gives the ratios θ3/θ4, θ5/θ4
and the pendulum's friction over θ4; the arm's row gives θ1, θ6, θ8 in units of the command. The scale θ4 itself is
only in the pendulum's weak reaction on the arm. So several scales, and generic ratios beside the regressed ones, run
a short race of prediction-error fits on a reduced log at high process noise; the winner starts the full fit.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.optimize import nnls

from furuta_gym.plant import Plant

from ..kalman.coordinates import Coordinate, filled_noise, filled_plant
from ..kalman.noise_model import Noise
from ..kalman.record import Record
from ..logs.checks import SHORTEST_STRETCH
from ..logs.log import Log
from ..logs.signs import motion_signs
from .optimise import Optimum, minimise
from .pool import mapped
from .prediction_error import PredictionError

_SMOOTHING = 0.02  # s, of the Gaussian: long against the encoder's counts, short against the motion
_TRUNCATED = 8.0  # widths: cut at scipy's 4, a second derivative keeps 1e-3/width² of the angle itself
_NO_COMMAND = 1e-9  # of the largest command: what rounding leaves of one that does not change
_TURNS = 4.0 * math.pi  # rad, between the farthest angles of a pendulum that turns over
_ROD = 0.75  # θ2/θ4 of a thin rod by Table 2
_RATIOS = ((0.9, 100.0), (1.4, 40.0))  # generic (θ3/θ4, θ5/θ4 [1/s²]): a palm-sized pendulum and an arm-sized one
_SCALES = (0.08, 0.25, 0.6)  # generic θ3²/(θ1 θ4), which is below 1 for every rig
SHARPNESS = 60.0
"""Of the friction that is regressed [s/rad]."""
_FEWEST = 5  # samples that a short record of a fast clock keeps
_FIRST_ITERATIONS, _LAST_ITERATIONS = 5, 25  # of all in the race, and of the two in front
_REDUCED = (4.0, 4e-3)  # s: duration and sample time of the log that the race runs on


Array = NDArray[np.float64]


@dataclass(frozen=True)
class Start:
    """A start of the fit."""

    plant: Plant
    noise: Noise


@dataclass(frozen=True)
class Motion:
    """Smoothed angles, rates and accelerations (n, 2) and command (n,), all through one linear filter. first: indices
    at which a log begins."""

    q: Array
    v: Array
    a: Array
    u: Array
    first: tuple[int, ...] = (0,)


def smoothed(logs: Sequence[Log]) -> Motion:
    """The motion of logs, one after the other; standing still where they are too short."""
    parts = []
    for log in logs:
        even = log if log.regular else log.resampled()
        T = even.sample_time
        width = max(_SMOOTHING / T, 1.5)
        margin = int(_TRUNCATED * width)
        if len(even) <= 3 * margin:
            continue
        y, held = even.angles, np.concatenate([even.u[:1], 0.5 * (even.u[1:] + even.u[:-1])])
        form = {"mode": "nearest", "truncate": _TRUNCATED}
        smooth = [gaussian_filter1d(y, width, axis=0, order=k, **form) / T**k for k in range(3)]
        parts.append([x[margin:-margin] for x in (*smooth, gaussian_filter1d(held, width, **form))])
    if not parts:
        parts = [[np.zeros((2, 2))] * 3 + [np.zeros(2)]]
    q, v, a, u = (np.concatenate(x) for x in zip(*parts, strict=True))
    ends = np.cumsum([len(part[0]) for part in parts])
    return Motion(q, v, a, u, (0, *ends[:-1].tolist()))


def nonnegative(columns: Sequence[Array], output: Array) -> Array:
    """Coefficients ≥ 0 of the least-squares fit, with columns scaled to unit length."""
    A = np.column_stack(columns)
    scale = np.linalg.norm(A, axis=0)
    scale[scale == 0] = 1.0
    return nnls(A / scale, output)[0] / scale


def candidates(logs: Sequence[Log], plant: Plant, known: Mapping[str, float] | None = None) -> list[Start]:
    """Start plants for `logs`, the most likely first; `plant` gives unit, effects and whatever is not θ or r.

    known: values (fixed, or means of priors) that settle the pendulum's scale where they hold θ2 … θ5. Raises
    ValueError where the logs give none: too short, without a command, or driven against its sign.
    """
    m = smoothed(logs)
    pendulum = PendulumRow.of(m)
    soft, a1, v1 = np.tanh(SHARPNESS * m.v[:, 0]), m.a[:, 0], m.v[:, 0]
    command = m.u
    hidden = nonnegative([a1, v1, soft], command)[0] <= 0
    if hidden and not any(motion_signs(log.t, log.q1, log.q2, log.u).command < 0 for log in logs):
        # a cable that is stronger than the inertia hides it
        pull = np.column_stack([m.q[:, 0], np.ones_like(a1)])
        command = command - pull @ np.linalg.lstsq(pull, command, rcond=None)[0]
    rows = (pendulum, *(PendulumRow(*ratios, 0.1, 0.1, generic=True) for ratios in _RATIOS))
    starts = [start for row in rows for start, _ in starts_with(m, row, plant, command, [soft], known)]
    if not starts:
        silent, why = _why_none(m, logs)
        kind = NoMotion if silent else ValueError
        raise kind(f"in {', '.join(dict.fromkeys(log.source for log in logs))} {why}")
    return starts


class NoMotion(ValueError):
    """Nothing in the logs gives start values, and nothing contradicts a plant that is given."""


def _why_none(m: Motion, logs: Sequence[Log]) -> tuple[bool, str]:
    """Whether logs of this smoothed motion only say nothing, and why they give no start, with what to do."""
    if not np.ptp(m.q, axis=0).any():
        seconds, samples = SHORTEST_STRETCH
        return True, (
            "no motion is long enough to be smoothed for start values. Expected axes that move, in a stretch of at "
            f"least {seconds:g} s and {samples} samples without a gap of the clock; record a longer one"
        )
    if np.ptp(m.u) <= _NO_COMMAND * max(float(np.abs(log.u).max()) for log in logs):
        return True, (
            "the command does not change where the motion can be smoothed for start values, so nothing tells the scale "
            "of the inertias. Expected a command that drives the arm there; add a driven log"
        )
    if np.ptp(m.q[:, 1]) > _TURNS:
        return True, (
            "the pendulum turns over again and again, which hides what the command does to the arm. Expected one that "
            "swings or balances; record a log with smaller commands, or leave the turns out (--cut)"
        )
    return False, (
        "a positive command does not drive the arm to the positive side: no inertia explains that. Check the signs "
        "(--flip u, q1 or q2), the column mapping and the units"
    )


@dataclass(frozen=True)
class PendulumRow:
    """The pendulum's row of (5) over θ4: θ3/θ4, θ5/θ4 [1/s²], θ7/θ4 and θ9/θ4. generic: of no rig in particular."""

    ratio3: float
    ratio5: float
    viscous: float
    coulomb: float
    generic: bool = False

    @classmethod
    def of(cls, m: Motion) -> PendulumRow:
        """Regressed on a motion, within what rigs have."""
        q2, v1, v2 = m.q[:, 1], m.v[:, 0], m.v[:, 1]
        s, c = np.sin(q2), np.cos(q2)
        row = nonnegative([-c * m.a[:, 0], s, v1 * v1 * s * c, -v2, -np.tanh(SHARPNESS * v2)], m.a[:, 1])
        ratios = float(np.clip(row[0], 0.1, 8.0)), float(np.clip(row[1], 8.0, 500.0))
        return cls(*ratios, max(float(row[3]), 0.01), max(float(row[4]), 0.01))

    def reaction(self, m: Motion) -> Array:
        """(n,) [1/s²]: what the pendulum does to the arm's row, over θ4."""
        (v1, v2), (a1, a2) = m.v.T, m.a.T
        s, c = np.sin(m.q[:, 1]), np.cos(m.q[:, 1])
        return self.ratio3 * (c * a2 - s * v2 * v2) + _ROD * (s * s * a1 + 2 * s * c * v1 * v2)


def starts_with(
    m: Motion,
    pendulum: PendulumRow,
    plant: Plant,
    command: Array,
    friction: Sequence[Array],
    known: Mapping[str, float] | None = None,
) -> list[tuple[Start, Array]]:
    """Starts at some scales of the pendulum's row, the arm's row regressed for each: with the coefficients ≥ 0 of
    `friction` (n,), of which the first is θ8."""
    known = known or {}
    a1, v1 = m.a[:, 0], m.v[:, 0]
    reaction = pendulum.reaction(m)
    measured = nonnegative([a1, reaction, v1, *friction], command)
    guessed = [f * measured[0] / pendulum.ratio3**2 for f in _SCALES]
    scales = guessed[1:2] if pendulum.generic else guessed
    if not pendulum.generic and guessed[0] / 3 < measured[1] < 0.9 * measured[0] / pendulum.ratio3**2:
        scales = [measured[1], *scales]
    weights = {"theta4": 1.0, "theta5": pendulum.ratio5, "theta3": pendulum.ratio3, "theta2": _ROD}
    if told := [known[n] / w for n, w in weights.items() if known.get(n, 0.0) > 0]:
        scales = told[:1]
    found = []
    for scale in (s for s in scales if s > 0):
        rest = nonnegative([a1, v1, *friction], command - scale * reaction)
        th1 = max(rest[0], 1.3 * scale * pendulum.ratio3**2, 1e-6)
        level = 0.02 * float(np.std(m.u)) + 1e-9
        th6, th8 = max(rest[1], level / (np.std(v1) + 0.1)), max(rest[2], level)
        row2 = scale * np.array([_ROD, pendulum.ratio3, 1.0, pendulum.ratio5, pendulum.viscous, pendulum.coulomb])
        theta = np.array([th1, *row2[:4], th6, row2[4], th8, row2[5]])
        # accelerations wrong by a third of what they are, for 10 ms
        restless = 0.01 * (0.3 * np.std(m.a, axis=0) + 0.1) ** 2 * np.array([th1, scale]) ** 2
        sharpness = (SHARPNESS, SHARPNESS) if isinstance(plant.friction_sharpness, tuple) else SHARPNESS
        start = plant.replace(theta=theta, friction_sharpness=sharpness)
        found.append((Start(start, Noise(restless)), rest[2:]))
    return found


def reduced(
    record: Record, duration: float = _REDUCED[0], sample_time: float = _REDUCED[1], clock: bool = False
) -> Record:
    """The liveliest `duration` seconds of a record at about `sample_time`, the command averaged over each sample.

    clock: keep the time of the record, which an effect that follows time needs; else it starts at zero."""
    T = float(np.median(np.diff(record.t)))
    n = len(record.t)
    length = min(n, max(int(min(duration / T, n)), 50))
    m = max(1, min(int(sample_time / T + 0.5), (length - 1) // _FEWEST))
    speed = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(record.y, axis=0)).sum(axis=1))])
    first = int(np.argmax(speed[length - 1 :: 1] - speed[: n - length + 1])) if length < n else 0
    index = np.arange(first, first + length, m)
    width = np.diff(record.t, append=record.t[-1] + T)
    charge = np.concatenate([[0.0], np.cumsum(width * record.u[:, 0])])
    held = np.diff(charge[np.append(index, min(index[-1] + m, n))])
    spans = np.diff(record.t[index], append=record.t[index[-1]] + float(np.sum(width[index[-1] : index[-1] + m])))
    start = float(record.t[first]) if clock else 0.0
    short = Record.from_arrays(record.t[index], record.y[index], held / spans, record.variance, record.quantum, start)
    return replace(short, log=record.log)


def race(
    records: Sequence[Record],
    starts: Sequence[Start],
    coordinates: Sequence[Coordinate],
    physical: bool = False,
    pool: Executor | None = None,
) -> tuple[Start, Optimum | None]:
    """Run short fits from all starts on reduced records; returns the start whose fit got furthest, refined.

    pool: where the fits run side by side, each in one thread (None: one after the other). The Optimum is that of the
    winner (None if every fit diverged: then the first start is returned).
    """
    clock = any(e.type.follows_clock for e in starts[0].plant.effects)
    coordinates = [c for c in coordinates if c.zero_of is None]  # too few seconds to tell them
    short = [reduced(r, _REDUCED[0] / max(1.0, len(records) / 2), clock=clock) for r in records]

    def run(start: Start, iterations: int, z: Array | None = None) -> tuple[PredictionError, Optimum]:
        problem = PredictionError(start.plant, short, coordinates, start.noise, coarser=2.0, physical=physical)
        return problem, minimise(problem, problem.start() if z is None else z, iterations, tolerance=0.1)

    results = list(mapped(pool, lambda s: run(s, _FIRST_ITERATIONS), starts))
    order = np.argsort([o.value for _, o in results])
    if not np.isfinite(results[order[0]][1].value):
        return starts[0], None
    finalists = [order[0]] + [i for i in order[1:2] if np.isfinite(results[i][1].value)]
    finished = list(mapped(pool, lambda i: run(starts[i], _LAST_ITERATIONS, results[i][1].z), finalists))
    _, best = min(finished, key=lambda r: r[1].value)
    noise = filled_noise(coordinates, best.z, starts[0].noise)
    return Start(filled_plant(starts[0].plant, coordinates, best.z), noise), best
