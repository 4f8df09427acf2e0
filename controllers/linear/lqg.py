"""LQG: the sampled LQR on the state of a Kalman filter that knows the encoders' noise."""

from typing import Any

import numpy as np

from furuta_gym.plant import Plant
from furuta_gym.sensors import Sensors

from ..design import DesignModel, Weights, choose_sample_time, choose_sensors, design_model, riccati
from .law import LinearController, observer_feedback
from .lqr import dlqr_gain


def measurement_noise(sensors: Sensors) -> np.ndarray:
    """Covariance (2, 2) [rad²] of the readings: a uniform rounding error, Δ²/12, and the sensors' own noise.

    Exact readings get a hundredth of a 4096-count encoder's, so that the filter exists.
    """
    variance = sensors.resolution**2 / 12 + np.asarray(sensors.noise_std) ** 2
    return np.diag(np.maximum(variance, (2 * np.pi / 409600) ** 2 / 12))


def kalman_gain(model: DesignModel, R: np.ndarray) -> np.ndarray:
    """Steady gain L (n, 2) of x̂ = x⁻ + L (y − C x⁻), from the covariance of `control.dlqe`."""
    import control

    n = model.size
    _, P, _ = riccati(control.dlqe, model.A, np.eye(n), model.C, model.noise, R)
    C = model.C
    return np.linalg.solve(C @ P @ C.T + R, C @ P).T


def design_lqg(
    plant: Plant,
    sample_time: float | None = None,
    sensors: Sensors | None = None,
    weights: Weights | None = None,
    **options: Any,
) -> LinearController:
    """LQR gain of the sampled plant on a Kalman filter's state, delay and lag of the plant included."""
    model = design_model(plant, choose_sample_time(plant, sample_time))
    K = dlqr_gain(model, weights or Weights.of(plant))
    L = kalman_gain(model, measurement_noise(choose_sensors(plant, sensors)))
    law = observer_feedback(K, L, model)
    return LinearController("lqg", law, plant, model, sensors=sensors, **options)
