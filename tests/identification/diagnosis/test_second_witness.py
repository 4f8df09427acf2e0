"""When multiple shooting is asked, and what its answer changes."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from furuta_gym.plant import TABLE_3
from identification.diagnosis import second_witness
from identification.diagnosis.gap_change import GapChange
from identification.diagnosis.held_out import HeldOut
from identification.validation.shooting import Shooting
from tests.factories import made_log
from tests.identification.diagnosis.fits import POLICY, a_change, a_diagnosis, a_gap

FOUND = TABLE_3.with_effects(TABLE_3.default_effect("arm_spring"))
SHOT = FOUND.replace(theta=TABLE_3.theta * np.array([1.0, 1.0, 1.0, 1.0, 1.1, 1.0, 1.0, 1.0, 1.0]))


def _asked(
    monkeypatch: pytest.MonkeyPatch,
    closed: tuple[float, float],
    still_off: float = 3.0,
    whole: bool = True,
    gap: GapChange | None = None,
    confirmed: bool = True,
) -> Any:
    """A diagnosis after the second witness, whose θ5 lies a tenth off with errors of a hundredth."""
    names = tuple(f"theta{i}" for i in range(1, 10))
    std = 0.01 * TABLE_3.theta
    shot = Shooting(SHOT, names, SHOT.theta, std, True)
    monkeypatch.setattr(second_witness, "shooting", lambda *_: shot)
    monkeypatch.setattr(HeldOut, "gap", lambda *_: None)
    monkeypatch.setattr(HeldOut, "change", lambda *_: a_change(closed))
    after: Any = SimpleNamespace(plant=FOUND, names=names, values=TABLE_3.theta, std=std, zeros={})
    found = replace(a_diagnosis("arm_spring", after=after), gap=gap or a_change(), still_off=still_off)
    found = replace(found, confirmed=confirmed)
    held = HeldOut((made_log(),), (made_log(),) if whole else (), POLICY)
    return second_witness.with_second_witness(found, held)


@pytest.mark.parametrize(("closed", "better"), [((0.1, 0.4), True), ((-0.1, 0.4), False), ((-0.5, -0.1), False)])
def test_the_plant_that_predicts_better_for_certain_is_used_and_marked(
    monkeypatch: pytest.MonkeyPatch, closed: tuple[float, float], better: bool
) -> None:
    found = _asked(monkeypatch, closed)
    assert found.second.better is better
    assert found.second.disagreeing == ("theta5",)
    assert "may have taken a missing torque for noise" in found.summary
    assert bool(found.plant.theta[4] == SHOT.theta[4]) is better
    assert (found.plant.provenance.get("method") == "multiple shooting") is better
    assert found.second.to_dict()["better"] is better


@pytest.mark.parametrize(
    ("times_floor", "of_readings", "asked"),
    [(1.2, 0.1, True), (1.2, 0.9, False), (1.05, 0.1, False)],
)
def test_it_is_asked_where_the_floor_is_torque_noise_that_may_hide_structure(
    monkeypatch: pytest.MonkeyPatch, times_floor: float, of_readings: float, asked: bool
) -> None:
    change = a_change()
    after = replace(a_gap(times_floor), reading_floor=of_readings * change.after.floor)
    found = _asked(monkeypatch, (0.1, 0.4), still_off=1.0, gap=replace(change, after=after))
    assert (found.second is not None) is asked
    assert ("In it: arm_spring" in found.summary) is asked


def test_it_is_not_asked_where_nothing_is_left_or_nobody_could_judge(monkeypatch: pytest.MonkeyPatch) -> None:
    assert _asked(monkeypatch, (0.1, 0.4), still_off=1.0).second is None
    assert _asked(monkeypatch, (0.1, 0.4), whole=False).second is None


def test_names_that_were_taken_back_have_no_second_witness(monkeypatch: pytest.MonkeyPatch) -> None:
    """The plant written is without them, and the summary says of no other."""
    found = _asked(monkeypatch, (0.1, 0.4), confirmed=False)
    assert found.second is None
    assert "multiple shooting" not in found.summary


def test_what_passes_for_adequate_is_the_policys(monkeypatch: pytest.MonkeyPatch) -> None:
    change = a_change()
    after = replace(a_gap(1.2), reading_floor=0.1 * change.after.floor)
    found = replace(a_diagnosis("arm_spring"), gap=replace(change, after=after))
    assert found.torque_floor_exceeded
    assert not replace(found, policy=replace(POLICY, adequate=1.5)).torque_floor_exceeded
