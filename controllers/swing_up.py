"""Swing up by energy, catch by the sampled LQR once it is sure to hold, and swing up again if it fell.

Åström and Furuta, "Swinging up a pendulum by energy control", Automatica 36 (2000), with the arm's acceleration as
the input; the torque for it follows from the plant's equations (collocated partial feedback linearization, Spong 1994).
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import Plant
from furuta_gym.plant.parameters import pendulum_frequency
from furuta_gym.sensors import Sensors

from .base import Controller, Reference
from .design import Weights, choose_sample_time, choose_sensors, design_model
from .known_effects import KnownEffects
from .linear import build_state_feedback
from .lqr import dlqr_gain
from .region import Region, region_of_attraction

ARM_SWING = 0.5  # rad; half-width of the arm's motion that pumping aims at
PUMP = 3.0  # of the energy that is missing, in units of θ5; beyond a third of θ5 pumping is at full effort
EXCESS = 0.02  # of θ5; friction takes it on the way up
CENTRING = 0.3  # of the pendulum's pace
LOST = 1.2  # rad; a balancing pendulum beyond it is swung up anew
RETURN_TIME = 1.0  # s; the arm's way back to its reference after the catch


class SwingUp(Controller):
    """Energy swing-up with hand-over to a balancer; see `design_swing_up`.

    `balancing` says, for each lane, whether the balancer is at work; `region` is where it takes over.
    """

    tasks = ("balance", "swing_up")

    def __init__(
        self,
        plant: Plant,
        sample_time: float,
        sensors: Sensors,
        weights: Weights,
        region: Region | None = None,
        reference: Reference = 0.0,
    ) -> None:
        super().__init__("swing-up", sample_time, plant.u_max, reference)
        self.plant = plant
        self.known = KnownEffects(plant)
        model = design_model(plant, sample_time)
        self.balancer = build_state_feedback("dlqr", dlqr_gain(model, weights), model, plant, sensors)
        self.region = region or region_of_attraction(self.balancer, plant, sensors, weights)
        self._law, self._matrix = self.balancer.law, self.balancer._matrix
        th1, _, th3 = plant.theta[:3]
        self.pace = pendulum_frequency(plant.theta)
        # a square wave of acceleration A ω² at the pendulum's pace moves the arm by about A to either side
        self.largest_acceleration = min(ARM_SWING * self.pace**2, 0.7 * min(np.abs(self.balancer.limits)) / th1)
        self._side = float(np.sign(th3))
        self._start()

    def _start(self) -> None:
        self._z: NDArray[np.float64] | None = None
        self.balancing: Any = False

    def _command(self, y: NDArray[np.float64], reference: float) -> Any:
        law, n = self._law, self._law.size
        q1, q2 = self.known.angles(y)
        q2 = q2 - self.balancer.q2e
        if self._z is None:
            self._z = law.Z @ np.stack([q1, q2])
            self._turns, self._goal, self.balancing = 0.0 * q1, q1, np.zeros(np.shape(q1), dtype=bool)
        # count the angle from the nearest upright position, but never under a balancer, which must not see a jump
        turns = np.where(self.balancing, self._turns, np.round(q2 / (2 * np.pi)))
        self._z[1] -= 2 * np.pi * (turns - self._turns)
        self._turns = turns
        out = self._matrix @ np.concatenate([self._z, np.stack([q1, q2 - 2 * np.pi * turns, self._goal])])
        x = out[n + 1 :]
        relative = np.stack([0.0 * q1, x[1], x[2], x[3]])
        caught = ~self.balancing & (self.region.value(relative) <= 1.0)
        self.balancing = (self.balancing | caught) & (np.abs(x[1]) < LOST)
        # the arm's reference starts where the arm was at the catch and goes home from there
        way = (reference - self._goal) * self.sample_time / RETURN_TIME
        goal = np.where(caught, q1, self._goal + way)
        hold = out[n] + law.D[2] * (goal - self._goal)
        self._goal = goal
        torque = np.clip(np.where(self.balancing, hold, self._pump(x)), *self.balancer.limits)
        self._z = out[:n] + np.multiply.outer(law.G, torque)
        return self.known.command(torque + self.balancer.holding_torque)

    def _pump(self, x: NDArray[np.float64]) -> Any:
        """Torque, less the holding one, that gives the pendulum the energy of rest upright, the arm near zero."""
        q1, q2, v1, v2 = x
        th4, th5 = self.plant.theta[3:5]
        cos = np.cos(q2)
        energy = 0.5 * th4 * v2 * v2 + th5 * (cos - 1.0)  # zero at rest upright
        effort = np.clip(PUMP * (EXCESS - energy / th5), -1.0, 1.0)
        swing = v2 * cos / self.pace
        # at rest there is nothing to be in phase with: start towards the arm's middle
        start = self._side * np.where(q1 > 0, 1.0, -1.0)
        phase = np.where((np.abs(swing) < 0.02) & (cos < -0.9), start, np.tanh(10.0 * swing))
        wanted = -self._side * self.largest_acceleration * effort * phase
        centring = -((CENTRING * self.pace) ** 2) * q1 - 2 * CENTRING * self.pace * v1
        return self.known.torque_for(wanted + centring, x) - self.balancer.holding_torque


def design_swing_up(
    plant: Plant,
    sample_time: float | None = None,
    sensors: Sensors | None = None,
    weights: Weights | None = None,
    **options: Any,
) -> SwingUp:
    """Swing-up for `plant`; the region in which the balancer takes over is estimated by simulation (about 0.2 s)."""
    T = choose_sample_time(plant, sample_time)
    return SwingUp(plant, T, choose_sensors(plant, sensors), weights or Weights.of(plant), **options)
