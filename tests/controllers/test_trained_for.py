"""What of a rig no episode of a policy's training had."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from controllers.comparison.trials import built_plants
from controllers.learned.policy import _settings, load_policy, load_to_export
from controllers.learned.trained_for import never_met
from furuta_gym.envs.options import Options, Setup
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
    own = LATE.replace(effects=(), randomize={"input_delay": "uniform:0,0.03"})
    assert never_met(record(own, randomize=True), LATE) == [], "what the plant file draws"
    assert never_met({}, LATE) == [], "a record that names no plant says nothing"


def test_a_narrower_limit_counts() -> None:
    rig = QUBE.replace(limits=LIMITS)
    said = ", ".join(never_met(record(), rig))
    assert said == "arm_travel of 1.5 (6.28319 there), arm_speed of 8 (no limit there), supply of 5 (10 there)"
    assert never_met(record(rig), rig) == []
    assert never_met(record(rig), QUBE) == [], "a wider one does not"
    assert "supply" not in "".join(never_met(record(randomize={"u_max": "uniform:4,10"}), rig))


@pytest.mark.parametrize(
    ("trained", "rig", "said"),
    [
        (QUBE, QUBE.replace(limits={"slew": 20.0}), ["slew of 20 (no limit there)"]),
        (QUBE, QUBE.replace(u_max=5.0), ["u_max of 5 (10 there)"]),
        (QUBE.replace(limits={"supply": 20.0}), QUBE.replace(limits={"supply": 15.0}), []),  # both motors get 10
    ],
)
def test_slew_and_the_largest_command_count_too(trained: Any, rig: Any, said: list[str]) -> None:
    assert never_met(record(trained), rig) == said


def test_an_export_of_such_a_policy_is_told() -> None:
    with pytest.warns(UserWarning, match="trained without input_delay, arm_travel of 1.5"):
        load_to_export(POLICY, LATE.replace(limits=LIMITS))


def test_clocks_that_differ_by_rounding_are_the_same() -> None:
    """A sample time from stamps, 50 ppm off: the policy acts on every fifth sample."""
    controller = load_policy(POLICY, QUBE.replace(sample_time=0.0040002))
    assert (controller.every, controller.sample_time) == (5, 0.0040002)
    with pytest.raises(ValueError, match="cannot play at"):
        load_policy(POLICY, QUBE, 0.0043)


def test_what_an_env_takes_may_stand_in_a_record() -> None:
    """A slip ring of 300 turns, and a filter that hardly filters."""
    rig = QUBE.replace(limits={"arm_travel": 2000.0}, sensors={"velocity_cutoff": 1e7})
    setup = Setup(Options.of({"plant": rig}))
    env = {"arm_limit": setup.arm_limit, "velocity_cutoff": setup.sensors.velocity_cutoff}
    assert env == {"arm_limit": 2000.0, "velocity_cutoff": 1e7}
    _settings(POLICY, record(rig, **env))


@pytest.mark.parametrize(
    ("plant", "env"),
    [
        ({"limits": [1]}, {}),
        ({"limits": {"slew": "x"}}, {}),
        ({"effects": [1]}, {}),
        ({"effects": {"input_delay": 1}}, {}),
        ({}, {"effect_probabilities": 3}),
    ],
)
def test_a_record_with_values_of_another_kind_is_refused(plant: dict[str, Any], env: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="values that no env has"):
        _settings(POLICY, {"plant": {**QUBE.to_dict(), **plant}, "env": env})


def test_neighbouring_seeds_have_no_rig_in_common() -> None:
    rigs = [{p.theta.tobytes() for p in built_plants(0.2, QUBE, 20, seed)} for seed in (0, 1)]
    assert rigs[0].isdisjoint(rigs[1])
    assert len(rigs[0]) == len(rigs[1]) == 20


def test_rigs_are_drawn_for_a_plant_that_is_sampled_faster_than_an_env() -> None:
    fast = QUBE.replace(sample_time=9.9998e-5)
    drawn, usual = built_plants(0.1, fast, 3, 0), built_plants(0.1, QUBE, 3, 0)
    assert [p.theta.tolist() for p in drawn] == [p.theta.tolist() for p in usual]
