"""What a controller says of the plant that it is for: whether it holds it, what moves its arm, what its run was."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from controllers import DesignError, compare, make_controller
from controllers.comparison.measured_run import run_figures
from controllers.design import balance_point
from controllers.envelope import Envelope, Guarded, breakaway
from controllers.exports.c import c_header
from controllers.registry import held
from furuta_gym.plant import QUBE, Effect, Plant
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import LivePlant, simulate
from identification.logs.log import Log, write_log
from tests.commands import furuta, refused
from tests.controllers.inside import COMPILER, compiled

LATE = QUBE.with_effects(Effect("input_delay", {"d": 0.02}))
SPRING = QUBE.with_effects(Effect("arm_spring", {"k": 3.0, "q1n": 0.0}))


def falls(plant: Plant, controller: Any) -> bool:
    """From where trials of balance start at most, within 30 s."""
    T = controller.sample_time
    return simulate(plant, controller, 30.0, T, x0=(0.5, 0.1, 0.0, 0.0), q2_limit=1.5).fell is not None


@pytest.mark.parametrize(
    ("plant", "name", "T"),
    [
        (LATE, "lqr", 0.004),
        (LATE, "dlqr", 0.004),
        (QUBE.with_effects(Effect("actuator_lag", {"T": 0.04})), "lqr", 0.004),
        (QUBE, "dlqr", 0.02),
        (SPRING, "lqr-friction", 0.004),
        (SPRING, "lqg-friction", 0.004),
        (QUBE.with_effects(Effect("arm_stribeck", {"ΔF": 0.3, "vs": 0.3})), "lqr-friction", 0.004),
        (QUBE.with_effects(Effect("arm_stribeck", {"ΔF": 0.3, "vs": 0.3})), "lqg-friction", 0.004),
    ],
)
def test_a_controller_is_held_back_where_it_lets_the_pendulum_fall(plant: Plant, name: str, T: float) -> None:
    controller = make_controller(name, plant, T)
    if falls(plant, controller):
        with pytest.raises(DesignError, match="does not hold this plant"):
            held(controller)
    else:
        assert held(controller) is controller


def test_no_firmware_gets_a_controller_that_does_not_hold(tmp_path: Path) -> None:
    LATE.save(tmp_path / "late.json")
    arguments = ["export", str(tmp_path / "late.json"), "-o", str(tmp_path / "c.h"), "--controller"]
    refused(furuta(*arguments, "lqr"), "does not hold this plant at 4 ms", "dlqr and lqg do not")
    assert not (tmp_path / "c.h").exists()
    assert furuta(*arguments, "lqg").exit_code == 0


def test_what_a_controller_cancels_is_not_in_its_loop() -> None:
    """A strong spring, nine tenths of which are cancelled: the poles are those of a tenth of it."""
    cancelling = make_controller("lqr-friction", SPRING, 0.004)
    slope = cancelling.known.effect_slopes()
    assert slope == pytest.approx([-3.0, 0.0, 0.0, 0.0], abs=1e-6)
    assert np.abs(cancelling.closed_loop_poles()).max() < 1.0
    without = make_controller("lqr-friction", QUBE, 0.004)
    assert without.known.effect_slopes().tolist() == [0.0] * 4


class TestTheCommandThatMustMoveTheArm:
    COUNT = 2.0 * math.pi / 2048

    def test_is_below_the_supply_or_says_nothing(self) -> None:
        for dry in (0.01, 0.1, 0.3, 0.6, 1.0):
            plant = QUBE.replace(theta=[*QUBE.theta[:7], dry, QUBE.theta[8]])
            for supply in (0.5, 1.5, 2.0, 10.0):
                level = breakaway(plant, self.COUNT, supply)
                assert level == math.inf or 1.5 * dry < level <= 0.9 * supply
                if level == math.inf:
                    assert 1.5 * dry + breakaway(QUBE, self.COUNT) > 0.9 * supply

    def test_an_encoder_that_stands_is_seen_with_a_weak_supply(self) -> None:
        """Three times the friction is more than the supply gives; the rule was never met."""
        plant = QUBE.replace(theta=[*QUBE.theta[:7], 0.6, QUBE.theta[8]], limits={"supply": 1.5})
        inside = Guarded(make_controller("lqg", plant, 0.004))
        assert inside.envelope.breakaway < 1.5
        rig, stuck = LivePlant(plant, 0.004, Sensors(2048), x0=(0.0, 0.02, 0.0, 0.0)), None
        while rig.t < 8.0 and inside.off == "on":
            q1, q2 = rig.read()
            stuck = q1 if stuck is None and rig.t >= 2.0 else stuck
            rig.step(inside((q1 if stuck is None else stuck, q2)))
        assert inside.off == "held"

    def test_follows_a_smaller_limit_that_is_given(self) -> None:
        plant = QUBE.replace(theta=[*QUBE.theta[:7], 0.6, QUBE.theta[8]])
        assert Envelope.of(make_controller("lqr", plant, 0.004), u_max=1.5).breakaway == pytest.approx(1.35)

    def test_knows_friction_that_an_effect_adds(self) -> None:
        """A rig that is held by Stribeck friction alone stands under commands that would move a bare one."""
        sticky = QUBE.replace(theta=[*QUBE.theta[:7], 0.001, QUBE.theta[8]])
        rough = sticky.with_effects(Effect("arm_stribeck", {"ΔF": 1.0, "vs": 0.3}))
        assert breakaway(rough, self.COUNT) > breakaway(sticky, self.COUNT) + 2.9
        inside = Guarded(make_controller("lqg", rough, 0.004))
        rig = LivePlant(rough, 0.004, Sensors(2048), x0=(0.0, 0.02, 0.0, 0.0))
        while rig.t < 15.0 and inside.off == "on":
            rig.step(inside(rig.read()))
        assert inside.off == "on"

    def test_knows_what_a_tilt_holds(self) -> None:
        tilted = QUBE.with_effects(Effect("base_tilt", {"αx": 0.1, "αy": 0.0, "G1": 2.0}))
        assert breakaway(tilted, self.COUNT) > breakaway(QUBE, self.COUNT) + 0.19

    def test_knows_what_a_spring_holds(self) -> None:
        far = breakaway(SPRING.replace(limits={"arm_travel": 1.0}), self.COUNT)
        assert far == pytest.approx(breakaway(QUBE, self.COUNT) + 3.0, rel=0.01)


@pytest.mark.skipif(COMPILER is None, reason="no C compiler (gcc, cc or clang) on this machine")
def test_an_envelope_without_a_tremor_is_c_that_compiles(tmp_path: Path) -> None:
    controller = make_controller("lqr", QUBE, 0.004)
    text = c_header(controller, "c", envelope=Envelope.of(controller, stirred=math.inf))
    assert compiled(text, tmp_path, "double")


def test_a_pendulum_without_weight_has_no_balance_point() -> None:
    light = QUBE.replace(theta=[*QUBE.theta[:4], 0.0, *QUBE.theta[5:]])
    with pytest.raises(DesignError, match="no balance point"):
        balance_point(light.with_effects(Effect("arm_spring", {"k": 0.0})))


def test_a_run_that_is_too_fast_has_failed() -> None:
    t = 0.004 * np.arange(500)
    q1 = np.where(t < 1.0, 0.0, 5.0 * (t - 1.0))
    columns = (t, q1, np.zeros(500), np.zeros(500))
    assert run_figures(*columns).success
    assert run_figures(*columns, arm_speed=5.1).success
    found = run_figures(*columns, arm_speed=4.9)
    assert found.failed_at == pytest.approx(1.0, abs=0.01)
    # one count in a sample is no speed
    count = 2.0 * math.pi / 2048
    steps = (t, count * (np.arange(500) // 250), np.zeros(500), np.zeros(500))
    assert not run_figures(*steps, arm_speed=0.5).success
    assert run_figures(*steps, arm_speed=0.5, count=count).success


def test_a_score_takes_off_what_the_encoders_read_wrongly(tmp_path: Path) -> None:
    """An encoder of the pendulum that is 0.06 rad off: the pendulum stood upright."""
    plant = QUBE.with_effects(Effect("pendulum_encoder_offset", {"b": 0.06})).replace(limits={"arm_speed": 20.0})
    plant.save(tmp_path / "off.json")
    rig, controller = LivePlant(plant, 0.004, Sensors(2048), x0=(0.05, 0.02, 0.0, 0.0)), make_controller("lqg", plant)
    controller.reset()
    rows = []
    while rig.t < 5.0:
        y = rig.read()
        u = controller(y)
        rows.append((rig.t, *y, u))
        rig.step(u)
    write_log(tmp_path / "run.csv", Log(*np.array(rows).T))
    line = ["score", str(tmp_path / "run.csv"), "--as-given", "--json"]
    (bare,) = json.loads(furuta(*line).stdout)["runs"]
    (known,) = json.loads(furuta(*line, "--plant", str(tmp_path / "off.json")).stdout)["runs"]
    assert bare["rms_q2"] > 0.05
    assert known["rms_q2"] < 0.01
    assert known["success"]


class TestAComparison:
    def test_says_how_many_trials_and_of_which(self) -> None:
        late = QUBE.with_effects(Effect("input_delay", {"d": 0.003}))
        found = compare(late, ["dlqr"], groups=["balance", "delay"], trials=40, duration=2.0)
        table = str(found)
        assert "40 trials each (10 under harder conditions)" in table
        assert "whose own delay is 3 ms" in table

    def test_recommends_what_held_at_the_period_that_was_played(self, tmp_path: Path) -> None:
        LATE.replace(sample_time=0.002).save(tmp_path / "fast.json")
        LATE.save(tmp_path / "late.json")
        line = ["compare", "--plant", str(tmp_path / "late.json"), "--groups", "balance", "--trials", "10"]
        line += ["--duration", "3", "-o", str(tmp_path / "out"), "--controllers", "lqg,lqr"]
        same = furuta(*line)
        assert "--controller lqg -o lqg.h" in same.stdout
        other = furuta(*line, "--design-plant", str(tmp_path / "fast.json"))
        assert "fast.json --controller lqg --sample-time 0.004 -o lqg.h" in other.stdout
