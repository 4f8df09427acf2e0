"""How far an arm coasts once the envelope has switched off."""

from __future__ import annotations

from experiments.studies.coasting import Coasting, coasted, said
from furuta_gym.plant import QUBE


def test_a_frozen_encoder_switches_off_and_the_arm_goes_on() -> None:
    plant = QUBE.replace(limits={"arm_travel": 1.5, "arm_speed": 8.0, "supply": 5.0})
    run = coasted(plant, 3.0)
    assert run.off in ("arm", "speed")
    assert run.further > 1.0
    assert "1 of 1 runs were switched off" in said([run])


def test_a_run_that_was_never_switched_off_is_told() -> None:
    assert said([Coasting(1.0, "on", 0.0, 0.0)]) == "1 runs: the envelope never switched off"
