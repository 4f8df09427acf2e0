"""Families of torques and reading errors that a plant might lack: smooth functions of one thing each.

Together they span what hardly any model can escape (a function of each angle, speed, the command and its last
hundredths of a second, changes of the parameters in time, memory of the motion, one frequency); singly they say against
what the missing torque lies.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import Plant
from furuta_gym.plant.regressor import regressor

from ..friction_memory import bristle
from ..kalman.path import FilterPath
from .dependence import ZEROS, Channel, Dependence, Variable

Array = NDArray[np.float64]

_LAGS = (0, 1, 2, 3, 4, 5, 6, 8, 10, 13, 17)  # samples of the fastest clock, of the command's changes
_SAME_CLOCK = 0.02  # of a sample time: medians of one clock that jitters differ by less
_MEMORY = (0.03, 0.1)  # s
_BRISTLES = (0.002, 0.008, 0.03)  # rad, of travel until a bristle slips


@dataclass(frozen=True)
class Signals:
    """Motion along a log, N samples: q, v, a (N, 2) [rad, rad/s, rad/s²], u (N,), t (N,) from the log's start [s].

    expected (N, 2) [rad]: the readings as the filter expects them before it sees them. An error of the reading must be
    a function of these: q knows the reading's noise, and a function of it would "explain" that noise.
    """

    t: Array
    q: Array
    v: Array
    a: Array
    u: Array
    expected: Array

    @classmethod
    def of(cls, path: FilterPath) -> Signals:
        """Of the states that a path is linearised about; accelerations are the plant's."""
        t, states = path.record.t, path.about
        a = np.zeros((len(t), 2))
        a[:-1] = (path.carried[1:, 2:4] - states[:-1, 2:4]) / np.diff(t)[:, None]
        return cls(t, states[:, :2], states[:, 2:4], a, path.record.u[:, 0], path.record.y - path.e)

    def way(self, row: int) -> Array:
        """(N,) [rad]: the way of a joint, 0 arm or 1 pendulum, by its speed."""
        return np.concatenate([[0.0], np.cumsum(self.v[:-1, row] * np.diff(self.t))])


@dataclass(frozen=True, kw_only=True)
class Columns:
    """m columns of torque (N, 2, m) on the two rows, or of reading error (N, 2, m) [rad]."""

    torque: Array | None = None
    misreading: Array | None = None

    @property
    def size(self) -> int:
        return (self.torque if self.torque is not None else self.misreading).shape[2]  # type: ignore[union-attr]


@dataclass(frozen=True)
class Family(Columns):
    """Columns, and what they stand for: where they enter, and what they depend on.

    price [nats]: what was gained by chance when the columns were chosen to suit the data. theta: of a parameter over
    time, its number (1 … 9).
    """

    channel: Channel
    variable: Variable
    price: float = 0.0
    theta: int | None = None

    @property
    def dependence(self) -> Dependence:
        """Parameters that change in time belong together: friction of each axis, and what the masses make."""
        if self.theta is None:
            return Dependence(self.channel, self.variable)
        return _IN_TIME.get(self.theta, Dependence(Channel.PENDULUM, Variable.MASSES_IN_TIME))


_IN_TIME = dict.fromkeys((6, 8), Dependence(Channel.ARM, Variable.FRICTION_IN_TIME)) | dict.fromkeys(
    (7, 9), Dependence(Channel.PENDULUM, Variable.FRICTION_IN_TIME)
)


@dataclass(frozen=True)
class Peaks:
    """Frequencies [Hz] of periodic torques worth trying, picked from the data among so many that were looked at."""

    hertz: tuple[float, ...] = ()
    looked_at: int = 1

    @property
    def price(self) -> float:
        """[nats]: the best of n lines of noise gains ln n by being the best."""
        return len(self.hertz) * math.log(self.looked_at)


def families(
    signals: Signals, plant: Plant, knots: Knots, peaks: Peaks, span: tuple[float, float] | None = None
) -> list[Family]:
    """Every family along a log. span [s]: of its clock, over which parameters may move; default: that of `signals`."""
    s = signals
    (q1, q2), (v1, v2), (y1, y2), u, t = s.q.T, s.v.T, s.expected.T, s.u, s.t
    r1, r2 = plant.sharpness
    c1, c2 = np.tanh(r1 * v1), np.tanh(r2 * v2)  # which way friction acts
    T = float(np.median(np.diff(t)))
    share = 1.0 if T / knots.clock < 1.0 + _SAME_CLOCK else knots.clock / T
    late = [u - _low_pass(u, tau / T) for tau in (0.005, 0.015, 0.04)]
    late += [_delayed(u, d * share) - _delayed(u, (d + 1) * share) for d in _LAGS]
    angle1, angle2 = hats(q1, knots.q1), hats(np.sin(q2), knots.q2)
    speed1 = [hats(v1, knots.v1), np.abs(c1), np.tanh(10.0 * v1), v1 * np.abs(v1)]
    speed2 = [hats(v2, knots.v2), np.abs(c2), np.tanh(10.0 * v2), v2 * np.abs(v2)]
    memory = [_low_pass(v1, tau / T) for tau in _MEMORY] + [bristle(s.way(0), z) for z in _BRISTLES]
    memory2 = [_low_pass(v2, tau / T) for tau in _MEMORY] + [bristle(s.way(1), z) for z in _BRISTLES]
    found = []
    for row, channel in enumerate((Channel.ARM, Channel.PENDULUM)):
        found += [
            Family(channel, Variable.CONSTANT, torque=on_row(row, np.ones_like(q1))),
            Family(channel, Variable.ARM_ANGLE, torque=on_row(row, angle1)),
            Family(channel, Variable.ARM_SPEED, torque=on_row(row, *speed1)),
            Family(channel, Variable.PENDULUM_ANGLE, torque=on_row(row, angle2)),
            Family(channel, Variable.PENDULUM_SPEED, torque=on_row(row, *speed2)),
            Family(channel, Variable.MEMORY, torque=on_row(row, *(memory if row == 0 else memory2))),
        ]
        if peaks.hertz:
            waves = [w(2 * math.pi * f * t) for f in peaks.hertz for w in (np.sin, np.cos)]
            found.append(Family(channel, Variable.FREQUENCY, torque=on_row(row, *waves), price=peaks.price))
    turned = on_row(0, np.sin(q1) * c1, np.cos(q1) * c1)
    read1, read2 = (np.sin(y1), np.cos(y1) - 1.0), (np.ones_like(y2), np.sin(y2), np.cos(y2) - 1.0)
    found += [
        Family(Channel.ARM, Variable.ARM_ANGLE_AND_DIRECTION, torque=turned),
        Family(Channel.INPUT, Variable.COMMAND, torque=on_row(0, hats(u, knots.u), u**3)),
        Family(Channel.INPUT, Variable.COMMAND_CHANGE, torque=on_row(0, *late)),
        Family(Channel.SENSOR, Variable.ARM_ANGLE, misreading=on_row(0, *read1)),
        Family(Channel.SENSOR, Variable.PENDULUM_ANGLE, misreading=on_row(1, *read2)),
    ]
    over_time = stages(t, span or (t[0], t[-1]))
    gains = on_row(0, *(u * stage for stage in over_time))
    found.append(Family(Channel.INPUT, Variable.GAIN_IN_TIME, torque=gains))
    for row, zero in enumerate(ZEROS.values()):
        found.append(Family(Channel.SENSOR, zero, misreading=on_row(row, *over_time)))
    torques = parameter_torques(s, plant)
    for i in range(9):
        changing = np.stack([torques[:, :, i] * stage[:, None] for stage in over_time], axis=2)
        found.append(Family(Channel.PARAMETERS, Variable.TIME, theta=i + 1, torque=changing))
    return found


def stages(t: Array, span: tuple[float, float]) -> list[Array]:
    """Five hats over time, whose sums are piecewise linear functions of it."""
    first, last = span
    return [np.clip(1.0 - np.abs(4.0 * (t - first) / (last - first) - j), 0.0, None) for j in range(5)]


def parameter_torques(signals: Signals, plant: Plant) -> Array:
    """−∂(M q̈ + C q̇ + g + friction)/∂θ along the motion (N, 2, 9): the torques that larger parameters would add."""
    return -regressor(signals.q, signals.v, signals.a, plant.sharpness)


@dataclass(frozen=True)
class Knots:
    """What columns along several logs share: where the piecewise linear functions bend, of q1, sin q2, q̇1, q̇2, u;
    and the sample time [s] of the fastest clock, in which delays are counted."""

    q1: Array
    q2: Array
    v1: Array
    v2: Array
    u: Array
    clock: float

    @classmethod
    def of(cls, logs: Sequence[Signals]) -> Knots:
        """At quantiles of what the logs visit together."""
        q, v = np.concatenate([s.q for s in logs]), np.concatenate([s.v for s in logs])
        u = np.concatenate([s.u for s in logs])
        columns = ((q[:, 0], 9), (np.sin(q[:, 1]), 7), (v[:, 0], 11), (v[:, 1], 11), (u, 9))
        bends = (np.unique(np.quantile(x, np.linspace(0.005, 0.995, m))) for x, m in columns)
        return cls(*bends, clock=min(float(np.median(np.diff(s.t))) for s in logs))


def hats(x: Array, knots: Array) -> Array:
    """Piecewise linear functions of x (N,), each 1 at one knot and 0 at the others (N, knots); flat outside."""
    if len(knots) < 2:
        return np.ones((len(x), 1))
    x = np.clip(x, knots[0], knots[-1])
    at = np.clip(np.searchsorted(knots, x, side="right") - 1, 0, len(knots) - 2)
    share = (x - knots[at]) / (knots[at + 1] - knots[at])
    out = np.zeros((len(x), len(knots)))
    out[np.arange(len(x)), at] = 1.0 - share
    out[np.arange(len(x)), at + 1] = share
    return out


def on_row(row: int, *columns: Array) -> Array:
    """Columns (N,) each as torques or errors of one row, 0 arm or 1 pendulum: (N, 2, m)."""
    stacked = np.column_stack(columns)
    out = np.zeros((len(stacked), 2, stacked.shape[1]))
    out[:, row] = stacked
    return out


def _delayed(u: Array, samples: float) -> Array:
    """A held command (N,) so many samples later, as its mean over each sample: between two values it is a mix."""
    at = np.arange(len(u))
    return np.interp(at - samples, at, u)


def _low_pass(x: Array, samples: float) -> Array:
    from scipy.signal import lfilter

    keep = math.exp(-1.0 / max(samples, 1e-3))
    return np.asarray(lfilter([1.0 - keep], [1.0, -keep], x, zi=[keep * x[0]])[0])
