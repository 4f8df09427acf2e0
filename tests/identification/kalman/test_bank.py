"""The bank of filters: which rows of P are a sharpness of friction, and what it does with them."""

from __future__ import annotations

import numpy as np
import pytest

from furuta_gym.plant import TABLE_3, Effect
from identification.kalman.noise_model import RecordNoise
from identification.kalman.path import along, follow
from identification.kalman.record import Record
from identification.kalman.sharpness import effective_sharpness, sharpness_rows
from tests.factories import TORQUE_NOISE, loop_log

SPEEDS = {"r1": 2, "r2": 3}  # the states q̇1 and q̇2


@pytest.mark.parametrize(
    "effects", [(), ("arm_spring",), ("friction_sharpness",), ("input_delay", "friction_sharpness")]
)
def test_each_sharpness_goes_with_the_speed_of_its_own_axis(effects: tuple[str, ...]) -> None:
    layout = TABLE_3.with_effects(*(Effect(name) for name in effects)).layout
    named = {layout.names[row]: state for row, state in sharpness_rows(layout)}
    own = {f"friction_sharpness.{name}": speed for name, speed in SPEEDS.items() if "friction_sharpness" in effects}
    assert named == SPEEDS | own


@pytest.mark.parametrize("axis", [0, 1], ids=["arm", "pendulum"])
def test_a_doubtful_speed_blunts_the_friction_of_its_own_axis_only(axis: int) -> None:
    """Linearised where one speed is badly known, a log is that of a plant whose r of that axis is the blunted one."""
    record = Record.from_log(loop_log(duration=2.0)[0])
    noise = RecordNoise(TORQUE_NOISE, record.variance)
    plant = TABLE_3.replace(friction_sharpness=(80.0, 120.0))
    path = follow(plant, record, noise)
    assert path is not None
    doubt = np.zeros((len(record.t), 2))
    doubt[:, axis] = 1e-3
    r = [80.0, 120.0]
    r[axis] = effective_sharpness(r[axis], 1e-3)
    blunt = follow(plant.replace(friction_sharpness=tuple(r)), record, noise)
    assert blunt is not None
    by_doubt, by_plant = along(path, path.filtered, doubt), along(blunt, path.filtered, np.zeros_like(doubt))
    assert by_doubt is not None
    assert by_plant is not None
    np.testing.assert_allclose(by_doubt.transition, by_plant.transition, rtol=1e-9, atol=1e-9)
