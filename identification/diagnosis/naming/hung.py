"""A zero of the pendulum's encoder that follows from another effect, as the counter was set while the pendulum hung."""

from __future__ import annotations

import math

import numpy as np

from furuta_gym.plant import Plant
from furuta_gym.sensors import angles_read

from ...kalman.coordinates import tells_the_zero
from .fits import Fit

_CAUSES = ("base_tilt", "pendulum_encoder_eccentricity")
_RESTING = 3  # first readings that do not change


def set_while_hanging(fitted: Fit) -> str | None:
    """The effect from which the wrong zero of the pendulum's encoder follows in a fit; None where the zero is an error
    of its own.

    A counter that is set to ±π while the pendulum hangs at rest is wrong by the tilt of the base at that angle of the
    arm, and an encoder off its centre is right there instead of upright. So it is if a log begins at rest with a
    reading of ±π, and the fitted plant has the pendulum at rest there, but would not have it without that effect.
    """
    plant = fitted.plant
    causes = [name for name in _CAUSES if plant.effect(name) is not None]
    if not tells_the_zero(plant) or not causes:
        return None
    for record in fitted.records:
        count, first = float(record.quantum[1]), record.y[:_RESTING, 1]
        if record.t[0] > 0.0 or np.ptp(first) > 0.0 or abs(abs(first[0]) - math.pi) > 0.5 * max(count, 1e-6):
            continue
        read = record.y[0] - np.array(fitted.zeros.get(record.log, (0.0, 0.0)))
        if _rests(plant, read, count):
            for name in causes:
                others = plant.without(name)
                if not _rests(others, read, count):
                    return name
    return None


def _rests(plant: Plant, read: np.ndarray, count: float) -> bool:
    """Whether the pendulum hangs at rest where the encoders read `read` (2,): within two counts, and the angle at which
    its friction holds it."""
    P, codes, _ = plant.packed()
    q1, q2 = angles_read(read[:, None], P[:, None], codes)[:, 0]
    lean, held = 0.0, plant.theta[8]
    if (tilt := plant.effect("base_tilt")) is not None:
        lean = math.atan(tilt.parameters["αx"] * math.sin(q1) - tilt.parameters["αy"] * math.cos(q1))
    if (stribeck := plant.effect("pendulum_stribeck")) is not None:
        held += stribeck.parameters["ΔF"]
    missed = abs(math.remainder(q2 - math.pi - lean, 2.0 * math.pi))
    return bool(missed < 2.0 * count + abs(held / plant.theta[4]))
