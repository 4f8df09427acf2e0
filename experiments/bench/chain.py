"""What stands between computer and motor, and between angles and counts: the parts of a rig that are not mechanics."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from .kernels.fields import blank
from .sets import ParameterSet


@dataclass
class CommandPath:
    """Command of the computer → command of the motor; the delay and the lag come after this."""

    gain: float = 1.0
    offset: float = 0.0
    offset_wander: float = 0.0  # relative, over a minute
    asymmetry: float = 0.0
    asymmetry_width: float = 0.0  # 0: a sharp change of gain at u = 0
    cubic: float = 0.0
    cubic_levels_off: bool = False
    dead_zone: float = 0.0
    dead_zone_round: bool = False
    limit: float = math.inf
    limit_round: bool = False
    delay: float = 0.0
    delay_flutter: float = 0.0  # relative standard deviation from sample to sample

    def value(self, u: float, t: float) -> float:
        """The motor's command for the computer's command u, given at time t [s]."""
        u = self.gain * u
        if self.offset:
            u += self.offset * (1.0 + self.offset_wander * math.sin(2.0 * math.pi * t / 60.0))
        if self.asymmetry:
            side = math.tanh(u / self.asymmetry_width) if self.asymmetry_width else math.copysign(1.0, u)
            u *= 1.0 + self.asymmetry * side
        if self.cubic:
            bend = self.cubic * u * u
            u *= 1.0 + (bend / (1.0 + 0.5 * abs(bend)) if self.cubic_levels_off else bend)
        if self.dead_zone:
            w = self.dead_zone
            u -= w * math.tanh(u / w) if self.dead_zone_round else min(max(u, -w), w)
        if math.isinf(self.limit):
            return u
        if self.limit_round:
            return u / (1.0 + (u / self.limit) ** 4) ** 0.25
        return min(max(u, -self.limit), self.limit)


@dataclass
class Encoders:
    """True angles → what the encoders would show if they had infinitely many counts."""

    offset2: float = 0.0
    offset2_creep: float = 0.0  # relative, a second
    eccentricity1: tuple[float, float] = (0.0, 0.0)
    eccentricity2: tuple[float, float] = (0.0, 0.0)
    off_centre: bool = False  # exact geometry of a disc mounted off its centre
    jumps2: tuple[tuple[float, float], ...] = ()  # (time [s], jump [rad]): counts that were lost

    def angles(self, q1: float, q2: float, t: float) -> tuple[float, float]:
        """Readings [rad] before rounding to counts."""
        y1 = q1 + self._error(q1, *self.eccentricity1)
        y2 = q2 + self._error(q2, *self.eccentricity2)
        if self.offset2:
            y2 += self.offset2 * (1.0 + self.offset2_creep * t)
        for when, jump in self.jumps2:
            if t >= when:
                y2 += jump
        return y1, y2

    def _error(self, q: float, a: float, b: float) -> float:
        if a == 0.0 and b == 0.0:
            return 0.0
        if not self.off_centre:
            return a * math.sin(q) + b * (math.cos(q) - 1.0)
        # the disc's centre sits at (−a, b) on the shaft's axes; to first order the line above
        turned = math.atan2(math.sin(q) + b, math.cos(q) - a)
        return math.remainder(turned - q, 2.0 * math.pi) - math.atan2(b, 1.0 - a)


@dataclass
class RandomTorque:
    """Low-pass filtered noise on the arm: rms in units of the command, bandwidth in Hz."""

    rms: float = 0.0
    bandwidth: float = 10.0


@dataclass
class Draft:
    """A rig while its effects are being put in."""

    kind: ParameterSet
    fields: np.ndarray = field(default_factory=blank)
    command: CommandPath = field(default_factory=CommandPath)
    encoders: Encoders = field(default_factory=Encoders)
    random_torque: RandomTorque = field(default_factory=RandomTorque)
    motor_share: float = 0.0
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def put(self, **values: float) -> None:
        """Set fields of the mechanics."""
        for name, value in values.items():
            self.fields[name] = value

    def join(self, kind: int, share: float, **values: float) -> None:
        """Separate the motor (that share of θ1) from the arm."""
        self.motor_share = share
        self.put(join=kind, **values)
