"""Swing up by energy, catch by the sampled LQR once it is sure to hold, and swing up again if it fell.

Åström and Furuta, "Swinging up a pendulum by energy control", Automatica 36 (2000), with the arm's acceleration as
the input; the torque for it follows from the plant's equations (collocated partial feedback linearization, Spong 1994).
Everything is decided from the state that is predicted for the moment at which the command takes hold (`Predictor`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import Plant
from furuta_gym.sensors import Sensors

from ..base import Reference
from ..comparison.trials import plants_off_by, run_trials, swing_up_starts
from ..design import Weights, choose_sample_time, choose_sensors
from .predictive import LOST, ROOM, PredictiveBalancer
from .predictor import without_delay
from .region import Region, region_of_attraction

PUMP = 10.0  # of the energy that is missing, in units of θ5; beyond a tenth of θ5 pumping is at full effort
PATIENCE = 3.0  # swings; energy that has not grown for so long, without a catch, asks for another try
FULL = 1.5  # of the acceleration that the largest torque gives an arm alone: the pendulum's pull wants more
BEGUN = 0.1  # rad, that the arm goes beyond its middle before a pendulum at rest is pushed the other way
GROWTH = 0.01  # of θ5; energy grows when it exceeds its largest value by this
REHEARSALS = (7, 14)  # swings; 7 are enough for most rigs
TRIES = 6  # ways of pumping, the best first, that are tried in turn


@dataclass(frozen=True)
class Pumping:
    """How the arm pumps: half-width of its motion [rad], how fast it is drawn to the middle (in units of the
    pendulum's pace), and the energy that is aimed at beyond that of rest upright, which friction takes (of θ5).
    """

    swing: float
    centring: float
    excess: float


WAYS = tuple(Pumping(*w) for w in product((0.5, 0.8, np.inf), (0.3, 0.2, 0.1), (0.05, 0.2, 0.35)))


class SwingUp(PredictiveBalancer):
    """Energy swing-up with hand-over to a balancer; see `design_swing_up`.

    `balancing` says, for each lane, whether the balancer is at work; `region` is where it takes over.
    """

    tasks = ("balance", "swing_up")
    patience = PATIENCE
    first: NDArray[np.int64] | None = None  # of `ways`, the one that each lane begins with; by default the best

    def __init__(
        self,
        plant: Plant,
        sample_time: float,
        sensors: Sensors,
        weights: Weights,
        region: Region,
        ways: Sequence[Pumping],
        reference: Reference = 0.0,
    ) -> None:
        super().__init__(plant, sample_time, sensors, weights, reference, name="swing-up")
        self.region, self.ways = region, tuple(ways)
        self._swing, self._centring, self._excess = np.array([(w.swing, w.centring, w.excess) for w in ways]).T
        th1, _, th3 = plant.theta[:3]
        # a square wave of acceleration A ω² at the pendulum's pace moves the arm by about A to either side
        self._full = min(np.abs(self.limits)) / th1
        self._side = float(np.sign(th3))
        lag = plant.effect("actuator_lag")
        # a held command acts, on average, half a sample after it has begun to, and a lagged one by the lag later
        self._beyond = 0.5 * sample_time + (lag.parameters["T"] if lag else 0.0)
        self._start()

    def _start(self) -> None:
        super()._start()
        self.balancing: Any = False

    def _begin(self, q1: NDArray[np.float64]) -> None:
        super()._begin(q1)
        lanes = q1.size
        self.balancing = np.zeros(lanes, dtype=bool)
        self._best, self._idle = np.full(lanes, -np.inf), np.zeros(lanes)
        self._push = np.where(q1 > 0, -1.0, 1.0)
        self._try = np.zeros(lanes, dtype=int) if self.first is None else self.first.copy()

    def _torque(self, reference: float) -> NDArray[np.float64]:
        now, later = self.predictor.ahead(self._beyond)
        q2 = now[1] - self.q2e
        # count the angle from the nearest upright position, but never under a balancer, which must not see a jump
        self._turns = np.where(self.balancing, self._turns, np.round(q2 / (2 * np.pi)))
        from_top = q2 - 2 * np.pi * self._turns
        relative = np.stack([0.0 * q2, from_top, now[2], now[3]])
        caught = ~self.balancing & (self.region.value(relative) <= 1.0) & self.has_room(now[0], relative)
        self.balancing = (self.balancing | caught) & (np.abs(from_top) < LOST)
        self._goal = np.where(caught, now[0], self._goal)
        hold = self._hold(now, reference)
        return np.where(self.balancing, hold, self._pump(later[:4]))

    def _pump(self, x: NDArray[np.float64]) -> Any:
        """Torque, less the holding one, that gives the pendulum the energy of rest upright, the arm near zero."""
        q1, q2, v1, v2 = x
        th4, th5 = self.plant.theta[3:5]
        cos = np.cos(q2 - self.q2e)
        energy = (0.5 * th4 * v2 * v2) / th5 + (cos - 1.0)  # in units of θ5, zero at rest upright
        self._watch(energy)
        effort = np.clip(PUMP * (self._excess[self._try] - energy), -1.0, 1.0)
        swing = v2 * cos / self.pace
        # at rest there is nothing to be in phase with: start towards the arm's middle, and keep to it, or a motor that
        # is asked for the other way at each sample moves nothing
        self._push = np.where(np.abs(q1) > BEGUN, -np.sign(q1), self._push)
        at_rest = (np.abs(swing) < 0.02) & (cos < -0.9)
        phase = np.where(at_rest, -self._side * self._push, np.tanh(10.0 * swing))
        largest = np.minimum(self._swing[self._try] * self.pace**2, FULL * self._full)
        wanted = -self._side * largest * effort * phase
        rate = self._centring[self._try] * self.pace
        centring = -rate * rate * q1 - 2 * rate * v1
        # what the arm needs to stop before its travel ends goes before the pendulum
        room = np.maximum(ROOM * self.travel - np.abs(q1), 0.0)
        late = (v1 * q1 > 0) & (v1 * v1 > self._full * room)
        wanted = np.where(late, -np.sign(v1) * self._full, wanted + centring)
        return self.known.torque_for(wanted, np.ascontiguousarray(x)) - self.holding_torque

    def _watch(self, energy: NDArray[np.float64]) -> None:
        """Another try where the energy has not grown for long: a wider or a smaller motion of the arm."""
        grown = (energy > self._best + GROWTH) | self.balancing
        self._best = np.where(self.balancing, -np.inf, np.where(grown, energy, self._best))
        self._idle = np.where(grown, 0.0, self._idle + self.sample_time)
        again = self._idle > self.patience * 2 * np.pi / self.pace
        self._try = (self._try + again) % len(self.ways)
        self._idle[again], self._best[again] = 0.0, -np.inf


@lru_cache(maxsize=32)
def catch_region(plant: Plant, sample_time: float, sensors: Sensors, weights: Weights) -> Region:
    """Where the balancer of `SwingUp` holds `plant`, in predicted states, tried out by simulation.

    Without the delay, which the prediction takes away."""
    rig = without_delay(plant)
    return region_of_attraction(PredictiveBalancer(rig, sample_time, sensors, weights), rig, sensors, weights)


@lru_cache(maxsize=32)
def rehearsed(plant: Plant, sample_time: float, sensors: Sensors, weights: Weights) -> tuple[Pumping, ...]:
    """The `TRIES` best of `WAYS` for `plant`, found by simulating each from twelve starts, with θ off by 5 %.

    Best is the least mean time to upright times 1 + (3 largest arm angle / travel)². They have `REHEARSALS` swings for
    it, as many as it takes one of them to be up from every start; who is not counts five times as long.
    """
    rig, starts = without_delay(plant), 12
    rehearsal = SwingUp(rig, sample_time, sensors, weights, catch_region(plant, sample_time, sensors, weights), WAYS)
    rehearsal.patience, rehearsal.first = np.inf, np.repeat(np.arange(len(WAYS)), starts)
    rigs = plants_off_by(0.05, rig, starts, np.random.default_rng(1)) * len(WAYS)
    swing = 2 * np.pi / rehearsal.pace
    cost = np.zeros(len(WAYS))
    for swings in REHEARSALS:
        played = run_trials(
            rigs,
            rehearsal,
            swing_up_starts(len(WAYS) * starts, np.random.default_rng(0), rehearsal.travel),
            swings * swing,
            sample_time,
            sensors,
            swing_up=True,
            hold=2 * swing,
        )
        up = played.success.reshape(-1, starts)
        time = np.where(up, played.settling.reshape(up.shape), 5 * swings * swing).mean(axis=1)
        arm = played.largest_q1.reshape(up.shape).max(axis=1)
        cost = time * (1.0 + (3.0 * arm / rehearsal.travel) ** 2)
        if up.all(axis=1).any():
            break
    return tuple(WAYS[i] for i in np.argsort(cost, kind="stable")[:TRIES])


def design_swing_up(
    plant: Plant,
    sample_time: float | None = None,
    sensors: Sensors | None = None,
    weights: Weights | None = None,
    **options: Any,
) -> SwingUp:
    """Swing-up for `plant`, which knows its delay, lag, friction and supply, and the rig's arm travel.

    Where the balancer takes over, and how the arm pumps, is found out by simulating the plant (about 2 s).
    Raises DesignError where nothing balances the plant.
    """
    T, seen = choose_sample_time(plant, sample_time), choose_sensors(plant, sensors)
    chosen = weights or Weights.of(plant)
    region, ways = (of(plant, T, seen, chosen) for of in (catch_region, rehearsed))
    given: dict[str, Any] = {"region": region, "ways": ways, **options}
    return SwingUp(plant, T, seen, chosen, **given)
