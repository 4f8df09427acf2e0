"""Linear quadratic regulators by python-control: continuous (`lqr`) and sampled (`dlqr`)."""

from typing import Any

import numpy as np

from furuta_gym.plant import Plant
from furuta_gym.plant.linearization import linearize
from furuta_gym.sensors import Sensors

from ..design import DesignModel, Weights, choose_sample_time, choose_sensors, design_model, riccati
from .law import LinearController, build_state_feedback


def lqr_gain(plant: Plant, weights: Weights | None = None) -> np.ndarray:
    """K (4,) of u = −K [q1, q2, q̇1, q̇2] for the continuous plant, by `control.lqr`."""
    import control

    weights = weights or Weights.of(plant)
    linear = linearize(plant)
    return riccati(control.lqr, linear.A, linear.B, weights.Q, weights.R)[0].ravel()


def dlqr_gain(model: DesignModel, weights: Weights) -> np.ndarray:
    """K (n,) over the states of the sampled model, its delay and lag included, by `control.dlqr`."""
    import control

    return riccati(control.dlqr, model.A, model.B, model.widened(weights.Q), weights.R)[0].ravel()


def design_lqr(
    plant: Plant,
    sample_time: float | None = None,
    sensors: Sensors | None = None,
    weights: Weights | None = None,
    **options: Any,
) -> LinearController:
    """Continuous LQR, played at the samples; it knows nothing of delay and lag."""
    model = design_model(plant, choose_sample_time(plant, sample_time))
    K = lqr_gain(plant, weights)
    return build_state_feedback("lqr", K, model, plant, choose_sensors(plant, sensors), **options)


def design_dlqr(
    plant: Plant,
    sample_time: float | None = None,
    sensors: Sensors | None = None,
    weights: Weights | None = None,
    **options: Any,
) -> LinearController:
    """LQR of the sampled plant; a delay or a lag that the plant carries is part of the state."""
    model = design_model(plant, choose_sample_time(plant, sample_time))
    K = dlqr_gain(model, weights or Weights.of(plant))
    return build_state_feedback("dlqr", K, model, plant, choose_sensors(plant, sensors), **options)
