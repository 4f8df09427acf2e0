"""The table of swing-ups: a small one, what it says of cells without a plan, and how long an MPC would compute."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("casadi", reason="planning needs the extra `plan`")

from controllers.base import DesignError
from controllers.comparison.statistics import Interval
from experiments.studies import swing_up_table
from experiments.studies.mpc_time import solve_times
from experiments.studies.swing_up_table import Cell, Played, Size, cell, missed, report, run, to_json
from furuta_gym.plant import QUBE, Plant


def test_the_hardest_cell_of_qube(tmp_path: Path) -> None:
    QUBE.save(tmp_path / "rig.json")
    found = run([str(tmp_path / "rig.json")], Size.quick())
    assert [(c.name, c.delay, c.u_max) for c in found] == [("rig", 16.0, 4.0)]
    designed, planned = (found[0].played[name] for name in ("swing-up", "planned"))
    assert designed.success.value == planned.success.value == 1.0
    assert designed.success.low == pytest.approx(0.8316, abs=1e-4)  # Clopper–Pearson of 20 of 20: 0.025^(1/20)
    assert found[0].plan[0] == pytest.approx(planned.settling.value, abs=0.1)
    assert planned.settling.value < designed.settling.value
    assert "| rig | 4 | 16 |" in report(found)
    assert "below 95 % in 0" in report(found)
    assert to_json(found, Size.quick())["cells"][0]["played"]["swing-up"]["success"]["n"] == 20


def test_a_cell_without_a_plan_is_none_that_was_missed() -> None:
    failed = Interval(0.0, 0.0, 0.1, 30)
    none = Interval(float("nan"), float("nan"), float("nan"), 0)
    played = Played(failed, none, none, 6.4, none, none)
    hopeless = Cell("rig", 0.0, 0.1, "no swing-up was found", {"swing-up": played})
    possible = Cell("rig", 0.0, 4.0, (1.0, 12.0), {"swing-up": played})
    assert missed([hopeless, possible]) == [possible]
    assert "A plan exists in 1 of 2 cells. The designed swing-up stays below 95 % in 1" in report([hopeless, possible])


def test_a_motor_that_cannot_balance_has_neither(monkeypatch: pytest.MonkeyPatch) -> None:
    def none(plant: Plant) -> None:
        raise DesignError(f"no swing-up was found within {plant.u_max:g} V")

    monkeypatch.setattr(swing_up_table, "plan_swing_up", none)
    found = cell("weak", QUBE, 0.0, 0.05, Size(trials=2, duration=6.0))
    assert found.plan == "no swing-up was found within 0.05 V"
    assert found.played == {}


def test_warm_solves_are_timed() -> None:
    taken, failed = solve_times(Plant.resolve("qube"), 10, solves=3)
    assert len(taken) + failed == 3
    assert all(0.001 < t < 10.0 for t in taken)
