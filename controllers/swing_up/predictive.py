"""The sampled LQR on a state that is predicted over the delay; what swing-ups catch and hold with."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import Plant
from furuta_gym.plant.parameters import pendulum_frequency
from furuta_gym.plant.plant_file import ARM_TRAVEL
from furuta_gym.sensors import Sensors

from ..base import Controller, Reference
from ..design import Weights, design_model
from ..linear.lqr import dlqr_gain
from .predictor import Predictor, feedback_state, lagged_torque_row, without_delay

LOST = 1.2  # rad; a pendulum beyond it is swung up anew
RETURN_TIME = 1.0  # s; the arm's way back to its reference
ROOM = 0.8  # of the arm's travel, which swinging up and catching may use


class PredictiveBalancer(Controller):
    """τ = −K x̂(t + delay), K the sampled LQR of the plant without its delay, x̂ of a `Predictor`.

    On a linear plant this is the LQR of the delayed plant. `goal` of the arm starts where the arm was and goes to the
    reference, as the LQR is for small ways only.
    """

    def __init__(
        self,
        plant: Plant,
        sample_time: float,
        sensors: Sensors,
        weights: Weights,
        reference: Reference = 0.0,
        name: str = "predictive",
    ) -> None:
        super().__init__(name, sample_time, plant.supply, reference)
        self.plant, self.sensors = plant, sensors
        self.predictor = Predictor(plant, sample_time, sensors)
        self.known = self.predictor.known
        self._model = design_model(without_delay(plant), sample_time)
        self._gain = dlqr_gain(self._model, weights)
        self._lag_row = lagged_torque_row(self.predictor.plant)
        self._step = plant.limit("slew", np.inf) * sample_time  # the most that a command changes
        self.travel, self.pace = plant.limit("arm_travel", ARM_TRAVEL), pendulum_frequency(plant.theta)
        # how far from where it was at the catch the arm goes from a state, while the linear loop holds
        loop = self._model.A - self._model.B @ self._gain[None]
        steps = np.unique(np.geomspace(1, 10.0 / (self.pace * sample_time) + 2, 20).astype(int))
        self._way = np.array([np.linalg.matrix_power(loop, n)[0, :4] for n in steps])
        self.q2e, self.holding_torque = self._model.q2e, self._model.torque
        self.limits = self.known.limits_about(self.holding_torque, name)
        self._start()

    def start_from(self, state: NDArray[np.float64]) -> None:
        """What is known before the first reading after `reset`: the true state (4, L)."""
        self._known_start = state

    _known_start: NDArray[np.float64] | None = None

    def _start(self) -> None:
        self.predictor.restart(self._known_start)
        self._goal: Any = None
        self._sent: Any = 0.0

    def _begin(self, q1: NDArray[np.float64]) -> None:
        self._goal, self._turns = q1.copy(), np.zeros_like(q1)

    def _command(self, y: NDArray[np.float64], reference: float) -> Any:
        X = self.predictor.update(y.reshape(2, -1))
        if self._goal is None:
            self._begin(X[0])
        torque = np.clip(self._torque(reference), *self.limits) + self.holding_torque
        u = np.clip(np.nan_to_num(self.known.command(torque)), -self.u_max, self.u_max)
        u = np.clip(u, self._sent - self._step, self._sent + self._step)  # the observer must know what gets through
        self._sent = u
        self.predictor.send(u)
        return u if y.ndim == 2 else u[0]

    def _torque(self, reference: float) -> NDArray[np.float64]:
        """Torque (L,) less the holding one, not yet limited."""
        return self._hold(self.predictor.ahead()[0], reference)

    def has_room(self, q1: NDArray[np.float64], relative: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether a catch keeps the arm within `ROOM` of its travel, from arm angles (L,) and from states (4, L) that
        count the arm from there and the pendulum from its balance point."""
        return np.abs(q1 + self._way @ relative).max(axis=0) < ROOM * self.travel

    def _hold(self, X: NDArray[np.float64], reference: float) -> NDArray[np.float64]:
        x = feedback_state(X, self._model, self._lag_row).copy()
        x[0] -= self._goal
        x[1] -= self.q2e + 2 * np.pi * self._turns
        self._goal = self._goal + (reference - self._goal) * self.sample_time / RETURN_TIME
        return -(self._gain @ x)
