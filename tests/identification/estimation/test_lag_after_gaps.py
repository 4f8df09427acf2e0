"""A lag's torque is not known where a stretch of a log begins: samples that are lost must not spoil a right model."""

from __future__ import annotations

import numpy as np
import pytest

from furuta_gym.plant import QUBE, Effect
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import open_loop, simulate
from identification import identify
from identification.logs.log import Log

LAG = 0.01  # s


@pytest.mark.filterwarnings("ignore::identification.logs.checks.LogWarning")
def test_lost_samples_leave_the_parameters_of_a_lagging_rig_known() -> None:
    """With a lag that begins each stretch at zero torque, the error bars were 37 to 92 %, and T was off."""
    rng = np.random.default_rng(5)
    T, n = 0.002, 3000
    plant = QUBE.with_effects(Effect("actuator_lag", {"T": LAG}))
    command = np.repeat(rng.choice([-2.0, 2.0], size=n // 30), 30)
    run = simulate(plant, open_loop(command), n * T, T, Sensors(4096), x0=(0.0, np.pi, 0.0, 0.0), seed=0)
    whole = Log.from_run(run, plant.unit, 4096)
    kept = rng.random(len(whole)) > 0.002
    kept[0] = True
    found = identify(whole.taken(kept), effects=("actuator_lag",))
    std = dict(zip(found.names, found.std, strict=True))
    assert not kept.all()
    assert abs(found.value("actuator_lag.T") - LAG) < 4.0 * std["actuator_lag.T"] < 4e-4
    for name, value in zip(("theta1", "theta3", "theta4", "theta5"), plant.theta[[0, 2, 3, 4]], strict=True):
        assert abs(found.value(name) - value) < 4.0 * std[name] < 0.04 * value
