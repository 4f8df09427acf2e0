"""What of a rig no episode of a policy's training had."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from controllers.learned import load_to_export
from controllers.trained_for import never_met
from furuta_gym.plant import QUBE, Effect

LATE = QUBE.with_effects(Effect("input_delay", {"d": 0.02}))
LIMITS = {"arm_travel": 1.5, "arm_speed": 8.0, "supply": 5.0}
POLICY = Path(__file__).resolve().parents[2] / "controllers" / "policies" / "swing-up-qube.zip"


def record(plant: Any = QUBE, **env: Any) -> dict[str, Any]:
    return {"plant": plant.to_dict(), "env": env}


def test_an_effect_counts_unless_the_plant_had_it_or_episodes_drew_it() -> None:
    assert never_met(record(), LATE) == ["input_delay"]
    assert never_met(record(LATE), LATE) == []
    assert never_met(record(randomize={"input_delay.d": "uniform:0,0.03"}), LATE) == []
    assert never_met(record(randomize="input_delay=uniform:0,0.03"), LATE) == []
    assert never_met(record(effect_probabilities={"input_delay": 0.5}), LATE) == []
    assert never_met(record(randomize=True), QUBE) == []
    assert never_met({}, LATE) == [], "a record that names no plant says nothing"


def test_a_narrower_limit_counts() -> None:
    rig = QUBE.replace(limits=LIMITS)
    said = ", ".join(never_met(record(), rig))
    assert said == "arm_travel of 1.5 (6.28319 there), arm_speed of 8 (no limit there), supply of 5 (10 there)"
    assert never_met(record(rig), rig) == []
    assert never_met(record(rig), QUBE) == [], "a wider one does not"
    assert "supply" not in "".join(never_met(record(randomize={"u_max": "uniform:4,10"}), rig))


def test_an_export_of_such_a_policy_is_told() -> None:
    with pytest.warns(UserWarning, match="trained without input_delay, arm_travel of 1.5"):
        load_to_export(POLICY, LATE.replace(limits=LIMITS))
