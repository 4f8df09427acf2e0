"""The closed loop that is pushed by hand, without a page."""

from __future__ import annotations

import shlex
from pathlib import Path

import numpy as np
import pytest

from controllers import make_controller
from experiments.studio import commands
from experiments.studio.loop import LONGEST, PULSE, Conditions, Loop, traces
from furuta_gym import Effect, Sensors
from furuta_gym.plant import TABLE_3
from tests.commands import furuta


def loop(conditions: Conditions | None = None, name: str = "lqr") -> Loop:
    return Loop(TABLE_3, make_controller(name, TABLE_3), conditions or Conditions(), Sensors())


def goes_on(at: Loop, seconds: float) -> Loop:
    for _ in range(round(seconds / 0.1)):
        at.run(0.1)
    return at


def test_it_balances_and_a_delay_that_it_was_not_told_of_brings_it_down() -> None:
    assert goes_on(loop(), 3.0).fell is None
    late = goes_on(loop(Conditions(delay=0.08)), 3.0)
    assert late.fell is not None
    assert goes_on(late, 0.1).live.command == 0.0


def test_a_push_moves_the_arm_its_own_way_and_ends() -> None:
    at = goes_on(loop(), 2.0)
    rest = float(at.live.state[0])
    speeds = []
    for share in (0.2, -0.2):
        pushed = goes_on(loop(), 2.0)
        before = float(pushed.live.state[2])
        pushed.push(share)
        pushed.run(PULSE / 5)
        speeds.append(float(pushed.live.state[2]) - before)
    assert speeds[0] > 0 > speeds[1]
    at.push(0.1)
    goes_on(at, 5.0)
    assert at.fell is None
    assert abs(float(at.live.state[0]) - rest) < 0.5


def test_a_hand_that_holds_pushes_until_it_lets_go() -> None:
    at = goes_on(loop(), 1.0)
    at.hold(0.3, row=1)
    assert at.torque == (0.0, pytest.approx(0.3 * TABLE_3.theta[4]))
    at.hold(0.0, row=1)
    assert at.torque == (0.0, 0.0)
    at.run(0.05)  # the push lasts a moment even so
    assert abs(at.live.state[3]) > 0.1


def test_conditions_change_while_it_moves() -> None:
    at = goes_on(loop(), 1.0)
    before = at.live.state
    at.change(Conditions(noise=0.01, effects=(Effect("arm_spring", {"k": 0.2, "q1n": 0.3}),)))
    assert (at.live.state == before).all()
    assert at.live.plant.effect("arm_spring") is not None
    readings = np.array([at.live.read()[1] for _ in range(50)])
    assert readings.std() == pytest.approx(0.01, rel=0.5)
    goes_on(at, 3.0)
    assert abs(at.live.state[0]) > 0.02  # the spring pulls


def test_a_page_that_slept_is_not_made_up_for() -> None:
    at = loop()
    at.run(100.0)
    assert at.live.t <= LONGEST + 1e-9


def test_a_swing_up_starts_hanging_and_its_past_is_drawn() -> None:
    at = goes_on(loop(name="swing-up"), 6.0)
    past = traces(at.past)
    assert past[-1, 0] - past[0, 0] == pytest.approx(5.0, abs=0.1)
    assert np.abs(past[:, 2]).max() <= np.pi
    assert abs(past[-1, 2]) < 0.3


def test_its_command_line_is_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    TABLE_3.save(tmp_path / "rig.json")
    conditions = Conditions(0.1, 0.0, (Effect("arm_spring", {"k": 0.1, "q1n": 0.3}),))
    result = furuta(*shlex.split(commands.closed_loop("rig.json", TABLE_3, "lqr", conditions))[1:])
    assert result.exit_code == 0, result.output
    assert "FELL" in result.output  # the controller was not told of the delay


def test_what_the_rig_has_is_beside_what_its_plant_has() -> None:
    """A delay and noise of the plant stay, and the sliders add to them."""
    late = TABLE_3.with_effects(Effect("input_delay", {"d": 0.01}))
    beside = Conditions(delay=0.005, noise=0.003)
    assert beside.plant(late).effect("input_delay").parameters["d"] == pytest.approx(0.015)
    assert np.allclose(beside.sensors(Sensors(noise_std=(0.004, 0.0))).noise_std, (0.005, 0.003))
    assert Conditions().plant(late) == late
    assert Conditions().sensors(Sensors(noise_std=0.004)) == Sensors(noise_std=0.004)
    line = commands.closed_loop("rig.json", late, "lqr", beside)
    assert "--effect input_delay:d=0.015" in line or "input_delay=0.015" in line, line
