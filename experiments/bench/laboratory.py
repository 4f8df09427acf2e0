"""A rig in motion: give a command, get the encoders' readings at the next sample."""

from __future__ import annotations

import math

import numpy as np

from .kernels.fields import CABLE, LAG_A, LAG_B, N_STATES, Q1, Q2, QM
from .kernels.stepper import N_WORK, advance
from .rigs import Rig


class Laboratory:
    """One rig, switched on.

    ```
    lab = Laboratory(rig, seed=1)
    y = lab.reset(q=(0.0, math.pi))     # hanging; readings (q1, q2) [rad]
    y = lab.step(0.5)                   # command held for one sample
    ```

    t [s] is the time stamp of the last reading, `state` (q1, q2, q̇1, q̇2) the truth, `period` the nominal sample
    time. Everything random (clock, noise, torques) comes from the seed, each from its own stream, so that two rigs
    that differ only in what they hide meet the same chance. noise_free: exact encoders, exact clock, no torque noise.
    """

    def __init__(self, rig: Rig, seed: int = 0, noise_free: bool = False, sample_time: float | None = None):
        self.rig = rig
        self.period = sample_time or rig.period
        self.u_max = rig.kind.u_max
        self._draft, self._body = rig.mechanics()
        self.engine = "lagrange" if self._body is None else "mujoco"
        self._link = self._body.link if self._body else tuple(np.zeros(2) for _ in range(5))
        self._quantum = tuple(2.0 * math.pi / c for c in rig.counts)
        self._noise_free = noise_free
        self._seed = seed
        self._work = np.zeros((N_WORK, N_STATES))
        self.reset()

    def reset(self, q: tuple[float, float] = (0.0, 0.0), v: tuple[float, float] = (0.0, 0.0)) -> tuple[float, float]:
        """Start at t = 0 from angles q [rad] and speeds v [rad/s]. Returns the first readings."""
        streams = np.random.SeedSequence([self._seed, 0xBE7C4]).spawn(4)
        self._clock, self._reading, self._torque, self._wire = (np.random.default_rng(s) for s in streams)
        self._x = np.zeros(N_STATES)
        self._x[:4] = (*q, *v)
        self._x[QM : QM + 2] = q[0], v[0]
        reach = float(self._draft.fields["cable_q"][0])
        self._x[CABLE] = min(max(q[0], -reach), reach)  # a cable that yields is relaxed at q1 = 0
        self._modes = np.array([0 if w == 0.0 else int(math.copysign(1, w)) for w in v])
        self._h = 1e-4
        self._k, self.t = 0, 0.0
        rest = self._draft.command.value(0.0, 0.0)
        self._tau = rest
        self._x[LAG_A] = self._x[LAG_B] = rest
        self._pending: list[tuple[float, float]] = []
        self._gust = 0.0
        return self._read()

    @property
    def state(self) -> np.ndarray:
        """(4,) true angles and speeds of arm and pendulum: q1, q2, q̇1, q̇2."""
        return self._x[:4].copy()

    @property
    def stuck(self) -> tuple[bool, bool]:
        """Which of the axes stand still by hard friction."""
        hard = bool(self._draft.fields["hard"][0])
        return hard and self._modes[0] == 0, hard and self._modes[1] == 0

    def step(self, u: float) -> tuple[float, float]:
        """Hold the command u (cut at ±u_max) until the next sample; returns the readings (q1, q2) [rad] there.

        They are NaN where the motion cannot be followed."""
        path = self._draft.command
        u = min(max(float(u), -self.u_max), self.u_max)
        value = path.value(u, self.t)
        delay = path.delay
        flutter = self._wire.standard_normal()
        if delay > 0.0:
            if path.delay_flutter:
                delay *= max(0.0, 1.0 + path.delay_flutter * flutter)
            self._pending.append((self.t + delay, value))
            self._pending.sort()
        else:
            self._tau = value
        self._k += 1
        end = self._next_stamp()
        n1, n2 = self._disturbance(end - self.t)
        while self._pending and self._pending[0][0] < end:
            at, value = self._pending.pop(0)
            self._move(max(at, self.t), n1, n2)
            self._tau = value
        self._move(end, n1, n2)
        return self._read()

    def _move(self, end: float, n1: float, n2: float) -> None:
        self._h = advance(
            self.t, end, self._x, self._modes, self._tau, n1, n2, self._draft.fields, self._link, self._work, self._h
        )
        self.t = end

    def _next_stamp(self) -> float:
        shift = self._clock.standard_normal()
        if self._noise_free:
            shift = 0.0
        return self.period * (self._k + self.rig.clock_jitter * min(max(shift, -2.0), 2.0))

    def _disturbance(self, span: float) -> tuple[float, float]:
        a, b, c = self._torque.standard_normal(3)
        if self._noise_free:
            return 0.0, 0.0
        s1, s2 = self.rig.torque_noise
        gust = self._draft.random_torque
        keep = math.exp(-2.0 * math.pi * gust.bandwidth * span)
        self._gust = keep * self._gust + math.sqrt(1.0 - keep * keep) * gust.rms * c
        return math.sqrt(s1 / span) * a + self._gust, math.sqrt(s2 / span) * b

    def _read(self) -> tuple[float, float]:
        # where something gives between motor and arm, the arm's encoder may sit on the motor
        seen = QM if self._draft.fields["friction_at_motor"][0] else Q1
        y1, y2 = self._draft.encoders.angles(float(self._x[seen]), float(self._x[Q2]), self.t)
        a, b = self._reading.standard_normal(2)
        if self._noise_free:
            return y1, y2
        noise, zero, (d1, d2) = self.rig.encoder_noise, self.rig.encoder_offset, self._quantum
        return _counts((y1 + zero[0] + noise * a) / d1) * d1, _counts((y2 + zero[1] + noise * b) / d2) * d2


def _counts(angle: float) -> float:
    """Whole counts; an angle that is not finite has none and stays what it is."""
    return round(angle) if math.isfinite(angle) else angle
