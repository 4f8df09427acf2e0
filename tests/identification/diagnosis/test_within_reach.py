"""Held-out logs in which the arm is not where the searched logs had it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from furuta_gym.plant import TABLE_3, Effect
from identification.diagnosis.gap_change import speaks_against
from identification.diagnosis.held_out import HeldOut
from identification.diagnosis.verify import judged, measure_gap
from identification.validation.gap import Gap
from tests.factories import made_log, open_loop_log
from tests.identification.diagnosis.fits import POLICY, a_change, a_diagnosis, a_fit, a_gap, an_estimate

BARE, CABLE, DRAG = a_fit(), a_fit("arm_spring"), a_fit("arm_quadratic_drag")


def _log(share: float = 0.0, turned: float = 0.0) -> Any:
    """An arm that swings within 0.3 rad, and around 2 rad for a share of the time; its zero may lie elsewhere."""
    log = made_log(n=1000, T=0.01)
    return replace(log, q1=log.q1 + np.where(log.t < (1.0 - share) * 10.0, 0.0, 2.0) + turned)


def _held(
    share: float, fitted: Any = CABLE, after: float = 40.0, turned: float = 0.0, zero: float = 0.0, both: float = 1.2
) -> HeldOut:
    """Held-out data in which the arm is elsewhere for a share of the time, with errors of so many times the floor
    without (5) and with an effect, and with one plant fitted to all logs."""
    held = HeldOut((_log(),), (_log(share, turned),), POLICY)
    for one, ratio in ((BARE, 5.0), (fitted, after)):
        gap: Gap = replace(a_gap(ratio, 100.0 * ratio), zeros={0: (zero, 0.0)})
        held._known[id(one.plant)] = one.plant, gap
    object.__setattr__(held, "jointly", lambda plant: _joint(plant, both))
    alone = 50.0  # nats of an effect on the searched log
    object.__setattr__(held, "_free", lambda plant, *_: SimpleNamespace(log_likelihood=alone * len(plant.effects)))
    return held


def _joint(plant: Any, both: float | None) -> Any:
    """A fit to all logs: an effect makes them likelier."""
    return None if both is None else (SimpleNamespace(log_likelihood=100.0 * len(plant.effects)), both)


@pytest.mark.parametrize(
    ("share", "fitted", "both", "excused"),
    [
        (0.5, CABLE, 1.2, True),  # an extrapolation, and one plant explains all logs
        (0.5, CABLE, 2.0, False),  # none does: another rig
        (0.5, CABLE, None, False),
        (0.02, CABLE, 1.2, False),  # the arm is hardly ever elsewhere
        (0.5, DRAG, 1.2, False),  # a drag does not depend on the angle
    ],
)
def test_what_depends_on_the_arms_angle_is_not_judged_where_the_arm_was_not(
    share: float, fitted: Any, both: Any, excused: bool
) -> None:
    held = _held(share, fitted, both=both)
    assert held.denies(BARE, fitted)
    assert held.excuses(BARE, fitted) is excused


def test_held_out_logs_speak_for_an_effect_wherever_the_arm_is() -> None:
    """To predict well where nothing was fitted is the better test."""
    held = _held(0.5, after=1.0)
    assert not held.denies(BARE, CABLE)
    assert held.confirms(BARE, CABLE)


def test_the_zero_of_each_log_is_taken_off_first() -> None:
    assert not _held(0.0, turned=2.0, zero=2.0).excuses(BARE, CABLE)
    assert _held(0.0, turned=2.0).excuses(BARE, CABLE)


@pytest.mark.parametrize(("together", "verdict"), [(1.2, "named"), (2.0, "unknown"), (None, "unknown")])
def test_the_verdict_follows_the_fit_to_all_logs_and_says_why(together: Any, verdict: str) -> None:
    asked: list[Any] = []

    def fit() -> Any:
        asked.append(together)
        return together

    outside = replace(a_change((-9.0, -1.0), after=30.0), searched_angles=(-0.5, 0.2))
    found = judged(a_diagnosis("arm_cable"), outside, fit)
    assert (found.verdict, found.confirmed) == (verdict, verdict == "named")
    assert ("leaves the angles of the searched ones (-0.5 to 0.2 rad)" in found.summary) is found.confirmed
    assert ("Diagnose all logs together" in found.summary) is found.confirmed
    assert len(asked) == 1  # it takes time
    inside = replace(outside, searched_angles=None)
    assert judged(a_diagnosis("arm_cable"), inside, fit).verdict == "unknown"


def test_a_cable_that_goes_slack_beyond_the_searched_angles_is_not_taken_back() -> None:
    """On the searched log it is a spring, and pulls less than one where the held-out arm goes later on."""
    rig = TABLE_3.with_effects(Effect("arm_taut_cable", {"k1": 0.5, "k2": 0.0, "q1n": 0.0, "qt": 0.9}))
    t = 0.004 * np.arange(2000)
    swings = 0.5 * np.sin(2.0 * np.pi * (0.3 + 0.05 * t) * t)
    searched = open_loop_log(swings, plant=rig)
    further = open_loop_log(swings + np.where(t < 3.0, 0.0, 0.8), plant=rig, seed=1)
    assert np.abs(searched.q1).max() < 0.9 < further.q1.max()
    spring = TABLE_3.with_effects(Effect("arm_spring", {"k": 0.5, "q1n": 0.0}))
    found = replace(a_diagnosis("arm_spring"), after=an_estimate(spring))
    gap = measure_gap(found, HeldOut((searched,), (further,), POLICY))
    assert speaks_against(gap, POLICY)
    assert gap.searched_angles == pytest.approx((searched.q1.min(), searched.q1.max()))
    assert judged(found, replace(gap, searched_angles=None), lambda: 1.2).verdict == "unknown"
    assert judged(found, gap, lambda: 1.2).verdict == "named"
    assert gap.to_dict()["searched_angles"] == list(gap.searched_angles)
    bare = measure_gap(a_diagnosis(verdict="none"), HeldOut((searched,), (further,), POLICY))
    assert bare.to_dict()["searched_angles"] is None
