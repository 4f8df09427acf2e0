"""Whether what is left goes with an effect's own variables."""

from __future__ import annotations

import numpy as np
import pytest

from experiments.bench import HiddenEffect, Rig
from furuta_gym.plant import EFFECTS, QUBE, TABLE_3, Effect
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import LivePlant
from identification.diagnosis.locate.evidence import evidence_of
from identification.diagnosis.locate.laws import own_families, own_variables, ways
from identification.diagnosis.locate.seen import Seen
from identification.diagnosis.policy import DecisionPolicy
from identification.logs.log import Log
from tests.factories import bench_log, loop_log

POLICY = DecisionPolicy()
LEARNED = "arm_learned"


@pytest.fixture(scope="module")
def pulled() -> Seen:
    """A spring where a cable is that stiffens to one side."""
    log, _ = loop_log("arm_cable")
    return Seen.of(TABLE_3.with_effects(TABLE_3.default_effect("arm_spring")), [log], POLICY)


def test_every_effect_has_variables_of_its_own_that_are_looked_at(pulled: Seen) -> None:
    known = {family.dependence for columns in pulled.columns for family in columns} | {("arm", "frequency")}
    for name in set(EFFECTS) - {LEARNED}:
        assert own_variables(name), name
        assert own_variables(name) <= known, name


def test_the_same_place_and_argument_is_the_same_variable() -> None:
    assert own_variables("arm_spring") == own_variables("arm_taut_cable") == {("arm", "arm angle")}
    assert own_variables("input_delay") == own_variables("actuator_lag")
    assert own_variables("arm_stribeck").isdisjoint(own_variables("pendulum_stribeck"))
    assert own_variables("arm_friction_drift").isdisjoint(own_variables("arm_stribeck"))
    assert own_variables("input_gain_drift").isdisjoint(own_variables("arm_friction_drift"))


def test_what_a_cable_leaves_of_a_spring_goes_with_the_angle(pulled: Seen) -> None:
    assert pulled.another_law("arm_spring") > 100.0
    assert pulled.another_law("input_delay") < 0.5 * pulled.another_law("arm_spring")


def test_the_right_law_leaves_nothing_that_goes_with_it() -> None:
    log, plant = loop_log("arm_spring")
    seen = Seen.of(plant, [log], POLICY)
    assert seen.another_law("arm_spring") < POLICY.left
    assert seen.another_law("input_dead_zone") < POLICY.left


AT_SCALE = {
    "arm_ripple": ["its own ripple"],
    "arm_position_friction": ["its own friction"],
    "periodic_torque": ["its own frequency"],
    "arm_encoder_eccentricity": ["its own turn"],
    "pendulum_encoder_eccentricity": ["its own turn"],
    "arm_backlash": ["memory at its own travel"],
    "arm_hysteresis": ["memory at its own travel"],
    "arm_presliding": ["memory at its own travel"],
}


@pytest.mark.parametrize("name", sorted(set(EFFECTS) - {LEARNED}))
def test_families_at_an_effects_own_scale_are_new_and_finite(name: str, pulled: Seen) -> None:
    signals = pulled.looks[0].signals
    plant = TABLE_3.with_effects(TABLE_3.default_effect(name))
    known = {family.dependence for family in pulled.columns[0]}
    variables = [family.variable for family in own_families(name, plant, signals, (0.0, 10.0))]
    assert [v for v in variables if "its own" in v] == AT_SCALE.get(name, [])
    speeds = any(variable == f"{channel} speed" for channel, variable in own_variables(name))
    assert ("near standstill" in variables) == speeds
    for family in own_families(name, plant, signals, (0.0, 10.0)):
        assert family.dependence not in known
        columns = family.torque if family.torque is not None else family.misreading
        assert columns is not None
        assert columns.shape[:2] == (len(signals.t), 2)
        assert np.isfinite(columns).all()
        assert np.abs(columns).max() > 0.0


def test_a_second_harmonic_is_another_law_of_a_ripple() -> None:
    """Too fast in the angle for the functions of it that `locate` knows."""
    rig = Rig("table3", [HiddenEffect("arm_ripple", 4.0, "bench")], sample_time=4e-3)
    log = bench_log(rig, "wide", seed=3, duration=10.0)
    truth = rig.truth()
    ripple = {name: v["value"] for name, v in truth["effects"][0]["parameters"].items()}
    plant = TABLE_3.replace(theta=np.array(list(truth["theta"].values())), effects=(Effect("arm_ripple", ripple),))
    seen = Seen.of(plant, [log], POLICY)
    assert seen.another_law("arm_ripple") > 100.0
    assert seen.another_law("arm_ripple") > 2.0 * seen.another_law("arm_spring")


def test_an_offset_that_wanders_is_another_law_of_it() -> None:
    """Over time, where functions of the command alone see little."""
    rig = Rig("table3", [HiddenEffect("input_offset", 20.0, "bench")], sample_time=4e-3)
    log = bench_log(rig, "paper", seed=3, duration=20.0)
    truth = rig.truth()
    b = {"b": truth["effects"][0]["parameters"]["b"]["value"]}
    plant = TABLE_3.replace(theta=np.array(list(truth["theta"].values())), effects=(Effect("input_offset", b),))
    seen = Seen.of(plant, [log], POLICY)
    assert seen.another_law("input_offset") > seen.another_law("input_gain_asymmetry") + 20.0


def test_a_smooth_law_of_a_cable_is_found_where_corners_show() -> None:
    """An exponential cable that a cubic nearly follows: polynomials see more than piecewise linear functions."""
    rig, T = QUBE.replace(sample_time=0.004), 0.004
    cable = Effect("arm_cable", {"k": 0.2, "q1n": 0.1, "k3": 0.05, "q1s": -0.9})
    plant = rig.with_effects(cable)
    live = LivePlant(plant, T, Sensors(2048), x0=(0.0, np.pi, 0.0, 0.0))
    rng = np.random.default_rng(4)
    rows, u = [], 0.0
    for k in range(4000):
        if k % 50 == 0:
            u = float(rng.uniform(-4.0, 4.0)) - 1.5 * live.state[0]
        rows.append((live.t, *live.read(), u))
        live.step(u, (0.05 * np.sin(3.0 * live.state[0] + 2.0), 0.0))
    t, q1, q2, command = np.array(rows).T
    log = Log(t, q1, q2, command, "V", encoder_counts=2048)
    assert np.ptp(q1) > 2.0
    seen = Seen.of(plant, [log], POLICY)
    own = own_families("arm_cable", plant, seen.looks[0].signals, (0.0, log.duration))
    columns = [[*seen.columns[0], *own]]
    hats, smooth = (evidence_of(seen.looks, columns, chosen).nats for chosen in ways("arm_cable", own))
    assert smooth > hats + 3.0
    assert seen.another_law("arm_cable") == pytest.approx(smooth, rel=1e-6)
    assert seen.another_law("arm_ripple") < 2.0 * smooth
