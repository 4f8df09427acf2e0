"""The paper's own controller: the gain of Eq. (24) in the convention u = −K x that makes it stable (errata, row 4)."""

from typing import Any

import numpy as np

from furuta_gym.plant import PAPER_GAIN, Plant
from furuta_gym.sensors import Sensors

from ..base import DesignError
from ..design import choose_sample_time, choose_sensors, design_model
from .law import LinearController, build_state_feedback

_ORDER = [0, 2, 1, 3]  # Eq. (24) has x = [q1, q̇1, q2, q̇2]


def design_paper_lqr(
    plant: Plant,
    sample_time: float | None = None,
    sensors: Sensors | None = None,
    printed_sign: bool = False,
    **options: Any,
) -> LinearController:
    """K of Eq. (24), δ = 0.8 included, velocities by the filtered difference.

    The gain belongs to the paper's rig. Raises DesignError on a plant that it does not stabilize.
    `printed_sign=True` plays u = +K x as printed, which falls; it is for showing just that.
    """
    model = design_model(plant, choose_sample_time(plant, sample_time))
    gain = (-1.0 if printed_sign else 1.0) * PAPER_GAIN[_ORDER]
    controller = build_state_feedback("paper-lqr", gain, model, plant, choose_sensors(plant, sensors), **options)
    if not printed_sign and (largest := np.abs(controller.closed_loop_poles()).max()) >= 1:
        raise DesignError(
            f"paper-lqr does not apply: with the paper's gain the closed loop is unstable on this plant (largest |z| = "
            f"{largest:.4f}). The gain is for the paper's own rig (Table 3, in volts). Use lqr, dlqr or lqg, which are "
            "designed for this plant"
        )
    return controller
