"""The planned swing-up played on a rig: a time-varying LQR keeps it to the plan, then the balancer takes over."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import Effect, Plant
from furuta_gym.plant.advance import advance
from furuta_gym.plant.linearization import HANGING, discretize, linearize
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import integration_step

from ..base import DesignError, Reference
from ..design import Weights, choose_sample_time, choose_sensors, riccati
from .energy import catch_region
from .planning import Plan, plan_swing_up
from .predictive import LOST, PredictiveBalancer
from .predictor import without_delay
from .region import Region

CALMING, FOLLOWING, BALANCING = range(3)
STILL = 0.15  # rad from hanging, and of the pendulum's pace: a plan can begin
ARM_STILL = 0.6  # rad
KEPT = 0.9  # of the arm's travel, by a plan from where it begins; the rest is the feedback's
EARLY = 0.7  # of the plan; from then on the balancer may take over


class PlannedSwingUp(PredictiveBalancer):
    """Plays `plan`; see `design_planned`. `phase` (L,) says what is done: calm the pendulum, follow, or balance.

    A plan begins where the arm is, if that keeps all of it within `KEPT` of the arm's travel. Else the arm is brought
    towards zero first."""

    tasks = ("balance", "swing_up")

    def __init__(
        self,
        plant: Plant,
        sample_time: float,
        sensors: Sensors,
        weights: Weights,
        plan: Plan,
        region: Region,
        reference: Reference = 0.0,
    ) -> None:
        super().__init__(plant, sample_time, sensors, weights, reference, name="planned")
        self.plan, self.region = plan, region
        if plan.state.shape[0] != self._model.size:
            raise DesignError(
                f"the plan has {plan.state.shape[0]} states and the plant {self._model.size} (q1, q2, their speeds "
                "and, with actuator_lag, the lagged torque); make the plan from this plant, or give none"
            )
        if plan.largest_q1 > KEPT * self.travel:
            raise DesignError(
                f"the plan takes the arm to {plan.largest_q1:.3g} rad, beyond {KEPT:g} of its travel of "
                f"{self.travel:.3g} rad; give another plan, or none"
            )
        self._times = np.arange(0.0, plan.duration, sample_time)
        self._x = np.stack([np.interp(self._times, plan.t, row) for row in plan.state])
        self._tau = plan.torque_at(self._times + 0.5 * sample_time)
        self._gains = self._tracking_gains(weights)
        self._calming = self._calming_gain(weights)
        self._start()

    def _start(self) -> None:
        super()._start()
        self.phase: Any = CALMING

    def _begin(self, q1: NDArray[np.float64]) -> None:
        super()._begin(q1)
        self.phase = np.full(q1.size, CALMING)
        self._k, self._from = np.zeros(q1.size, dtype=int), np.zeros((2, q1.size))

    def _torque(self, reference: float) -> NDArray[np.float64]:
        now = self.predictor.ahead()[0]
        n = self._times.size
        down = 2 * np.pi * np.round((now[1] - np.pi) / (2 * np.pi))
        hanging = now[1] - np.pi - down
        speeds = np.maximum(np.abs(now[2]), np.abs(now[3])) / self.pace
        ready = (np.abs(hanging) < STILL) & (speeds < STILL) & (np.abs(now[0]) < ARM_STILL)
        ready &= np.abs(now[0] + self.plan.state[0][:, None]).max(axis=0) <= KEPT * self.travel
        begins = (self.phase == CALMING) & ready
        self._from = np.where(begins, np.stack([now[0], down]), self._from)
        self._k = np.where(begins, 0, self._k)
        self.phase = np.where(begins, FOLLOWING, self.phase)
        follows = self.phase == FOLLOWING
        k = np.minimum(self._k, n - 1)
        self._turns = np.where(self.phase == BALANCING, self._turns, np.round((now[1] - self.q2e) / (2 * np.pi)))
        from_top = now[1] - self.q2e - 2 * np.pi * self._turns
        relative = np.stack([0.0 * from_top, from_top, now[2], now[3]])
        inside = (self.region.value(relative) <= 1.0) & self.has_room(now[0], relative)
        caught = inside & ((self.phase == CALMING) | (follows & (self._k >= EARLY * n)))
        self._goal = np.where(caught, now[0], self._goal)
        fell = (self.phase == BALANCING) & (np.abs(from_top) > LOST)
        over = fell | (follows & (self._k >= n) & ~caught)
        self.phase = np.where(caught, BALANCING, np.where(over, CALMING, self.phase))
        hold = self._hold(now, reference)
        rows = self._x.shape[0]
        error = (now[:4] if rows == 4 else np.vstack([now[:4], now[self._lag_row]])) - self._x[:, k]
        error[:2] -= self._from
        track = self._tau[k] - np.einsum("ij,ji->i", self._gains[k], error)
        calm = -(self._calming @ np.stack([now[0], hanging, now[2], now[3]]))
        self._k = self._k + 1
        torque = np.choose(self.phase, [calm, track, hold + self.holding_torque])
        return torque - self.holding_torque

    def _tracking_gains(self, weights: Weights) -> NDArray[np.float64]:
        """K (samples, rows) of the time-varying LQR, backwards from the balancer's cost at the plan's end."""
        import control

        model, rig = self._model, _moved_by_torque(self.predictor.plant)
        Q, R = model.widened(weights.Q), weights.R
        P = riccati(control.dlqr, model.A, model.B, Q, R)[1]
        gains = np.empty((self._times.size, self._x.shape[0]))
        for k in range(self._times.size - 1, -1, -1):
            A, B = _slopes(rig, self._x[:, k], self._tau[k], self.sample_time)
            K = np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)
            P = Q + A.T @ P @ (A - B @ K)
            P = 0.5 * (P + P.T)
            gains[k] = K[0]
        return gains

    def _calming_gain(self, weights: Weights) -> NDArray[np.float64]:
        import control

        A, B = discretize(linearize(self.plant, HANGING), self.sample_time)
        return riccati(control.dlqr, A, B, weights.Q, weights.R)[0].ravel()


def _off(effect: Effect) -> bool:
    """Whether an effect is carried at sizes at which it does nothing."""
    sizes = [p for p in effect.type.parameters if p.role == "size"]
    return all(effect.parameters[p.name] == p.neutral for p in sizes)


def _moved_by_torque(plant: Plant) -> Plant:
    """The plant whose command is the torque that the motor is asked for: only the lag is left of its command path."""
    return plant.keeping(lambda effect: effect.name == "actuator_lag")


def _slopes(
    plant: Plant, x: NDArray[np.float64], torque: float, sample_time: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(A, B) of the plant over one sample about a state x (n,) and a torque held, by central differences."""
    p, codes, rows = plant.packed()
    n = x.size
    step = 1e-5 * np.maximum(1.0, np.abs(np.append(x, torque)))
    X, U = np.tile(x[:, None], (1, 2 * n + 2)), np.full((1, 2 * n + 2), torque)
    for i in range(n + 1):
        row = X[i] if i < n else U[0]
        row[2 * i] += step[i]
        row[2 * i + 1] -= step[i]
    P, W = np.repeat(p[:, None], 2 * n + 2, axis=1), np.zeros((2, 2 * n + 2))
    assert rows == n
    advance(X, 0.0, sample_time, np.zeros(1), U, 0, W, P, codes, integration_step(plant, 2e-3, sample_time))
    slopes = (X[:, 0::2] - X[:, 1::2]) / (2 * step)
    return slopes[:, :n], slopes[:, n:]


def design_planned(
    plant: Plant,
    sample_time: float | None = None,
    sensors: Sensors | None = None,
    weights: Weights | None = None,
    **options: Any,
) -> PlannedSwingUp:
    """The fastest swing-up of `plan_swing_up`, followed by a time-varying LQR; see there for what it needs.

    A pendulum that does not hang still enough is calmed first. It is a reference for time and effort: a plan knows
    one start, and a rig that differs from the plant leaves it. options: `plan` of one's own, `reference`.
    """
    plant = plant.keeping(lambda effect: not _off(effect))
    T, seen = choose_sample_time(plant, sample_time), choose_sensors(plant, sensors)
    chosen = weights or Weights.of(plant)
    region = catch_region(plant, T, seen, chosen)  # first, as it is soon known where nothing balances
    plan = options.pop("plan", None) or plan_swing_up(without_delay(plant))
    return PlannedSwingUp(plant, T, seen, chosen, plan, region, **options)
