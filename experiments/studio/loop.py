"""A controller on a plant that moves while one looks at it: pushed, delayed, disturbed. No page in here."""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from controllers import Controller
from controllers.comparison.variations import delay_of, longest_delay, noisier
from furuta_gym import Effect, LivePlant, Plant, Sensors
from furuta_gym.simulation import FALLEN

SHOWN = 5.0  # s of the past that are drawn
PULSE = 0.15  # s that a push lasts at least
LONGEST = 0.2  # s that are made up for at once, where the page has waited
_DRAWN = 0.02  # s between two points of the past


@dataclass(frozen=True)
class Conditions:
    """What the rig has that the controller was not told of: a delay of the command [s], white noise of the readings
    [rad], and effects."""

    delay: float = 0.0
    noise: float = 0.0
    effects: tuple[Effect, ...] = ()

    def added(self, base: Plant) -> tuple[Effect, ...]:
        """The effects that the rig has beside those of `base`, its whole delay among them."""
        if self.delay <= 0:
            return self.effects
        late = min(delay_of(base) + self.delay, longest_delay())
        return (*self.effects, Effect("input_delay", {"d": late}))

    def plant(self, base: Plant) -> Plant:
        """The rig: `base` with the effects, and later by the delay."""
        return base.with_effects(*self.added(base))

    def sensors(self, own: Sensors) -> Sensors:
        """Those of the rig: with noise beside their own."""
        return noisier(own, 1e3 * self.noise) if self.noise > 0 else own


class Loop:
    """A closed loop that goes on in steps of a sample. base: the plant that the controller is made for.

    Raises ValueError where a sample takes too many steps of integration."""

    def __init__(self, base: Plant, controller: Controller, conditions: Conditions, sensors: Sensors) -> None:
        self.base, self.controller, self.sensors = base, controller, sensors
        self.conditions = conditions
        self.torque = (0.0, 0.0)
        self._moving = threading.Lock()  # the page changes conditions while a worker steps
        self._pulse, self._left = (0.0, 0.0), 0.0
        self.start()

    def start(self) -> None:
        """Again from where the controller's task begins: near upright, or hanging."""
        hanging = "swing_up" in self.controller.tasks
        x0 = (0.0, math.pi if hanging else 0.03, 0.0, 0.0)
        plant, T = self.conditions.plant(self.base), self.controller.sample_time
        self.live = LivePlant(plant, T, self._noisy(), x0)
        self.controller.reset()
        self.fell: float | None = None
        self.past: deque[tuple[float, float, float, float]] = deque(maxlen=round(SHOWN / _DRAWN))
        self._behind = 0.0

    def change(self, conditions: Conditions) -> None:
        """Other conditions from now on; the motion goes on."""
        with self._moving:
            self.live.exchange(conditions.plant(self.base))
            self.conditions = conditions
            self.live.sensors = self._noisy()

    def push(self, share: float, row: int = 0) -> None:
        """A short push on the arm (row 0) or the pendulum (row 1), as a share of `strength`."""
        self._pulse, self._left = self._torque(share, row), PULSE

    def hold(self, share: float, row: int = 0) -> None:
        """A push that lasts until it is taken back by a share of 0, and then for `PULSE` at least."""
        if share == 0.0:
            self._pulse, self._left = self.torque, PULSE
        self.torque = self._torque(share, row)

    def strength(self, row: int) -> float:
        """The torque [{u}] of a whole push: as much as the motor has on the arm, as much as gravity on the pendulum."""
        return self.base.u_max if row == 0 else abs(float(self.base.theta[4]))

    def run(self, seconds: float) -> None:
        """Go on by so much time. Raises FloatingPointError where the motion leaves all bounds."""
        T = self.live.sample_time
        self._behind = min(self._behind + seconds, LONGEST)
        while self._behind >= T:
            self._behind -= T
            with self._moving:
                self._step()

    def _step(self) -> None:
        live = self.live
        y = live.read()
        command = 0.0 if self.fell is not None else float(self.controller(y))
        torque = np.array(self.torque)
        if self._left > 0:
            torque = torque + self._pulse
            self._left -= live.sample_time
        live.step(command, torque)
        q2 = float(live.state[1])
        if "swing_up" not in self.controller.tasks and self.fell is None and abs(q2) > FALLEN:
            self.fell = live.t
        if live.samples % max(1, round(_DRAWN / live.sample_time)) == 0:
            self.past.append((live.t, float(y[0]), float(y[1]), live.command))

    def _torque(self, share: float, row: int) -> tuple[float, float]:
        size = float(share) * self.strength(row)
        return (size, 0.0) if row == 0 else (0.0, size)

    def _noisy(self) -> Sensors:
        return self.conditions.sensors(self.sensors)


def traces(past: Sequence[tuple[float, float, float, float]]) -> NDArray[np.float64]:
    """The past as an array (n, 4): t [s], q1, q2 [rad] as read, with whole turns of q2 taken off, command [{u}]."""
    found = np.array(past, dtype=float).reshape(-1, 4)
    found[:, 2] = np.remainder(found[:, 2] + np.pi, 2 * np.pi) - np.pi
    return found
