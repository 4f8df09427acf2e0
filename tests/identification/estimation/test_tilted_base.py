"""What a fit makes of a tilted base: gravity gives its moment one sign."""

from __future__ import annotations

import math

from furuta_gym.plant import TABLE_3, Effect
from identification.estimation.identify import identify
from identification.logs.log import Log
from tests.factories import TORQUE_NOISE, closed_loop

TILT = {"αx": 0.03, "αy": 0.02}
"""The direction in which the pendulum's row is tilted [rad]."""


def moment(*effects: Effect) -> tuple[float, float]:
    """G1 [V] that a fit of a tilted base finds on a rig with some effects, and its standard deviation."""
    rig = TABLE_3.with_effects(*effects)
    run = closed_loop(rig, 0.004, 8.0, seed=1, torque_noise=TORQUE_NOISE, longest_step=5e-4)
    estimate = identify(Log.from_run(run, rig.unit, 4096), effects=["base_tilt"])
    return estimate.value("base_tilt.G1"), float(estimate.std[estimate.names.index("base_tilt.G1")])


def test_the_moment_of_a_tilted_base_is_found() -> None:
    """To what its error bar says, a twentieth: a wrong zero of the pendulum is a tilt until the arm turns."""
    found, std = moment(Effect("base_tilt", {**TILT, "G1": 2.0}))
    assert std < 0.12
    assert abs(found - 2.0) < 3.0 * std


def test_a_torque_that_no_gravity_gives_is_not_taken_for_a_tilt() -> None:
    """An arm that is drawn uphill: a ripple of one period a turn against the tilt that the pendulum shows."""
    size, angle = math.hypot(*TILT.values()), math.atan2(TILT["αy"], TILT["αx"])
    uphill = Effect("arm_ripple", {"A": 2.0 * size, "n": 1.0, "φ": math.pi - angle})
    found, _ = moment(Effect("base_tilt", {**TILT, "G1": 0.0}), uphill)
    assert 0.0 <= found < 0.1
