"""LQR with integral action on the arm angle: the arm comes to its reference against offsets, cables and tilt."""

from typing import Any

import numpy as np
from scipy.linalg import block_diag

from furuta_gym.plant import Plant
from furuta_gym.sensors import Sensors

from ..design import DesignModel, Weights, choose_sample_time, choose_sensors, design_model, riccati
from .law import LinearController, LinearLaw, state_feedback

INTEGRAL_TIME = 2.0  # s; an arm error held for so long weighs as much as the error itself


def lqi_gain(model: DesignModel, weights: Weights) -> np.ndarray:
    """K (n + 1,) over the sampled plant and the integral of q1 − r, by `control.dlqr`."""
    import control

    n, T = model.size, model.sample_time
    A = np.zeros((n + 1, n + 1))
    A[:n, :n], A[n, 0], A[n, n] = model.A, T, 1.0
    Q = block_diag(model.widened(weights.Q), (weights.q1 * INTEGRAL_TIME) ** -2)
    return riccati(control.dlqr, A, np.vstack([model.B, [[0.0]]]), Q, weights.R)[0].ravel()


def with_integral(law: LinearLaw, gain: float, sample_time: float, unwinding_time: float) -> LinearLaw:
    """`law` minus gain · ∫(q1 − r) dt. While the torque is limited the integral unwinds in `unwinding_time` [s]."""
    n = law.size
    C, D = np.append(law.C, -gain), law.D
    unwind = -sample_time / unwinding_time / gain
    A = np.asarray(block_diag(law.A, 1.0))
    A[n] -= unwind * C
    B = np.vstack([law.B, np.array([sample_time, 0.0, -sample_time]) - unwind * D])
    zero = np.zeros((4, 1))
    return LinearLaw(
        A, B, np.append(law.G, unwind), C, D, np.vstack([law.Z, [[0.0, 0.0]]]), np.hstack([law.E, zero]), law.F
    )


def design_lqi(
    plant: Plant,
    sample_time: float | None = None,
    sensors: Sensors | None = None,
    weights: Weights | None = None,
    **options: Any,
) -> LinearController:
    """`dlqr` of the plant with ∫(q1 − r) dt as a further state, weighted by Bryson's rule over 2 s."""
    model = design_model(plant, choose_sample_time(plant, sample_time))
    K = lqi_gain(model, weights or Weights.of(plant))
    law = state_feedback(K[:-1], model, choose_sensors(plant, sensors).velocity_cutoff)
    law = with_integral(law, K[-1], model.sample_time, INTEGRAL_TIME)
    return LinearController("lqi", law, plant, model, sensors=sensors, **options)
