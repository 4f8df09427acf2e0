"""How far from upright a balancer still catches the pendulum: a level of a quadratic Lyapunov function, tried out."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import Plant
from furuta_gym.plant.linearization import linearize
from furuta_gym.plant.parameters import pendulum_frequency
from furuta_gym.plant.plant_file import ARM_TRAVEL
from furuta_gym.sensors import Sensors

from ..base import Controller, DesignError
from ..comparison.trials import Starts, run_trials
from ..design import Weights
from .predictive import PredictiveBalancer

_WIDEST = 1.0  # rad from upright, up to which starts are tried
_SEED = 0


@dataclass(frozen=True)
class Region:
    """The states with xᵀ P x ≤ level, x = [q1, q2, q̇1, q̇2]; `tried` starts with q1 = 0 inside it all came to rest."""

    P: NDArray[np.float64]
    level: float
    tried: int

    def value(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """xᵀ P x / level for x (4,) or (4, L): at most 1 inside."""
        return np.einsum("i...,ij,j...->...", x, self.P, x) / self.level


def region_of_attraction(
    controller: Controller,
    plant: Plant,
    sensors: Sensors,
    weights: Weights | None = None,
    tries: int = 400,
) -> Region:
    """Estimate the region in which `controller` balances `plant`, torque limits, encoders and friction included.

    V = xᵀ P x is the cost of the continuous LQR, a Lyapunov function of the linear loop. `tries` random starts with
    q1 = 0, spread over the levels up to |q2| = `_WIDEST`, run for 30/ω with the pendulum's ω = √(θ5/θ4); the level
    is nine tenths of the lowest from which one failed. Raises DesignError if even the smallest fail.
    """
    import control

    weights = weights or Weights.of(plant)
    linear = linearize(plant)
    P = np.asarray(control.lqr(linear.A, linear.B, weights.Q, weights.R)[1])
    inner = P[1:, 1:]
    highest = _WIDEST**2 / np.linalg.inv(inner)[0, 0]  # of V at which the ellipsoid reaches |q2| = _WIDEST
    rng = np.random.default_rng(_SEED)
    directions = rng.standard_normal((3, tries))
    directions /= np.sqrt(np.einsum("ik,ij,jk->k", directions, inner, directions))
    levels = highest * np.linspace(1.0 / tries, 1.0, tries)
    x0 = np.vstack([np.zeros(tries), directions * np.sqrt(levels)])
    starts = Starts(x0, np.zeros(tries), np.zeros(tries))
    duration = 30.0 / pendulum_frequency(plant.theta)
    if isinstance(controller, PredictiveBalancer):
        controller.start_from(x0)
    # a narrow travel makes no state unsafe: the catch counts the way from where the arm is
    outcome = run_trials(
        plant, controller, starts, duration, controller.sample_time, sensors, arm_travel=ARM_TRAVEL, seed=_SEED
    )
    lowest = np.flatnonzero(~outcome.success)
    inside = int(lowest[0]) if lowest.size else tries
    if inside < 3:
        small = [f"the largest command, {plant.supply:g} {plant.unit},"]
        for name, unit in (("slew", f"{plant.unit}/s"), ("arm_speed", "rad/s")):  # limits that the trials keep to
            if (limit := plant.limit(name, np.inf)) < np.inf:
                small.append(f"the limit {name}, {limit:g} {unit},")
        raise DesignError(
            f"{controller.name} cannot hold this plant even close to upright: {' or '.join(small)} may be too small, "
            "the sample time too long, or the encoders too coarse"
        )
    return Region(P, float(0.9 * levels[inside - 1]), inside)
