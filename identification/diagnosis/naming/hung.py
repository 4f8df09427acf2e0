"""A zero of the pendulum's encoder that follows from another effect, as the counter was set while the pendulum hung."""

from __future__ import annotations

import math

import numpy as np

from furuta_gym.sensors import angles_read

from .fits import Fit

OFFSET = "pendulum_encoder_offset"
_TILT, _OFF_CENTRE = "base_tilt", "pendulum_encoder_eccentricity"
_RESTING = 3  # first readings that do not change


def set_while_hanging(fitted: Fit) -> str | None:
    """The effect from which the wrong zero of the pendulum's encoder follows in a fit; None where the zero is an error
    of its own.

    A counter that is set to ±π while the pendulum hangs at rest is wrong by the tilt of the base at that angle of the
    arm, and an encoder off its centre is right there instead of upright. So it is if a log begins at rest with a
    reading of ±π, and the fitted plant has the pendulum at rest there: within two counts, and the angle θ9/θ5 at which
    Coulomb friction holds it.
    """
    plant = fitted.plant
    tilt, off_centre = plant.effect(_TILT), plant.effect(_OFF_CENTRE)
    if plant.effect(OFFSET) is None or not (tilt or off_centre):
        return None
    P, codes, _ = plant.packed()
    columns = P[:, None]
    for record in fitted.records:
        count, first = float(record.quantum[1]), record.y[:_RESTING, 1]
        if record.t[0] > 0.0 or np.ptp(first) > 0.0 or abs(abs(first[0]) - math.pi) > 0.5 * max(count, 1e-6):
            continue
        read = record.y[0] - np.array(fitted.zeros.get(record.log, (0.0, 0.0)))
        q1, q2 = angles_read(read[:, None], columns, codes)[:, 0]
        lean = 0.0
        if tilt is not None:
            αx, αy = tilt.parameters["αx"], tilt.parameters["αy"]
            lean = math.atan(αx * math.sin(q1) - αy * math.cos(q1))
        held = 2.0 * count + abs(plant.theta[8] / plant.theta[4])
        if abs(math.remainder(q2 - math.pi - lean, 2.0 * math.pi)) < held:
            return _TILT if abs(lean) > held or off_centre is None else _OFF_CENTRE
    return None
