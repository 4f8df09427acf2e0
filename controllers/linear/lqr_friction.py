"""LQR and LQG with the arm's friction cancelled: what remains is nearer to the linear plant they are designed for."""

from typing import Any

from furuta_gym.plant import Plant
from furuta_gym.sensors import Sensors

from ..design import DesignModel, Weights, choose_sample_time, choose_sensors, design_model
from .law import LinearController, observer_feedback, state_feedback
from .lqg import kalman_gain, measurement_noise
from .lqr import dlqr_gain

# Of the friction, so that an estimate that is a tenth too large does not yet push the arm by itself.
SHARE = 0.9


def _without_arm_effects(plant: Plant, sample_time: float | None) -> DesignModel:
    # what is cancelled has no place in the linear design
    rest = plant.keeping(lambda effect: effect.type.place != "arm")
    return design_model(rest, choose_sample_time(plant, sample_time))


def design_lqr_friction(
    plant: Plant,
    sample_time: float | None = None,
    sensors: Sensors | None = None,
    weights: Weights | None = None,
    **options: Any,
) -> LinearController:
    """`dlqr` that also cancels 90 % of the Coulomb torque θ8 tanh(q̇1/(0.1 rad/s)) and of the arm's known effects."""
    model = _without_arm_effects(plant, sample_time)
    K = dlqr_gain(model, weights or Weights.of(plant))
    law = state_feedback(K, model, choose_sensors(plant, sensors).velocity_cutoff)
    return LinearController("lqr-friction", law, plant, model, sensors=sensors, friction_share=SHARE, **options)


def design_lqg_friction(
    plant: Plant,
    sample_time: float | None = None,
    sensors: Sensors | None = None,
    weights: Weights | None = None,
    **options: Any,
) -> LinearController:
    """`lqg` that also cancels it, at the velocity that the Kalman filter estimates."""
    model = _without_arm_effects(plant, sample_time)
    K = dlqr_gain(model, weights or Weights.of(plant))
    law = observer_feedback(K, kalman_gain(model, measurement_noise(choose_sensors(plant, sensors))), model)
    return LinearController("lqg-friction", law, plant, model, sensors=sensors, friction_share=SHARE, **options)
