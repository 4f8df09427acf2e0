"""Held-out logs in which the arm is not where the searched logs had it."""

from __future__ import annotations

from dataclasses import replace
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
WORSE, BETTER = (5.0, 40.0), (5.0, 1.0)
"""Times the floor, without an effect and with it."""


def _log(share: float = 0.0, turned: float = 0.0) -> Any:
    """An arm that swings within 0.3 rad, and around 2 rad for a share of the time; its zero may lie elsewhere."""
    log = made_log(n=1000, T=0.01)
    return replace(log, q1=log.q1 + np.where(log.t < (1.0 - share) * 10.0, 0.0, 2.0) + turned)


def _known(held: HeldOut, fitted: Any, times: tuple[float, float], zero: float = 0.0) -> None:
    for one, ratio in zip((BARE, fitted), times, strict=True):
        gap: Gap = replace(a_gap(ratio, 100.0 * ratio), zeros={0: (zero, 0.0)})
        held._known[id(one.plant)] = one.plant, gap


def _held(
    share: float, fitted: Any = CABLE, whole: Any = WORSE, tail: Any = BETTER, turned: float = 0.0, zero: float = 0.0
) -> HeldOut:
    held = HeldOut((_log(),), (_log(share, turned),), POLICY)
    _known(held, fitted, whole, zero)
    _known(held.tails, fitted, tail)
    return held


@pytest.mark.parametrize(
    ("share", "fitted", "tail", "against"),
    [
        (0.5, CABLE, BETTER, False),  # an extrapolation, and the end of the searched log agrees with it
        (0.5, CABLE, WORSE, True),  # which does not
        (0.02, CABLE, BETTER, True),  # the arm is hardly ever elsewhere
        (0.5, DRAG, BETTER, True),  # a drag does not depend on the angle
    ],
)
def test_what_depends_on_the_arms_angle_is_not_judged_where_the_arm_was_not(
    share: float, fitted: Any, tail: Any, against: bool
) -> None:
    held = _held(share, fitted, tail=tail)
    assert held.denies(BARE, fitted)
    assert held.excuses(BARE, fitted) is not against


def test_held_out_logs_speak_for_an_effect_wherever_the_arm_is() -> None:
    """To predict well where nothing was fitted is the better test; the searched log is not asked."""
    held = _held(0.5, whole=BETTER, tail=WORSE)
    assert not held.denies(BARE, CABLE)
    assert held.confirms(BARE, CABLE)
    assert held.excuses(BARE, CABLE) is False


def test_the_zero_of_each_log_is_taken_off_first() -> None:
    assert not _held(0.0, turned=2.0, zero=2.0).excuses(BARE, CABLE)
    assert _held(0.0, turned=2.0).excuses(BARE, CABLE)


def test_the_verdict_follows_the_searched_log_and_says_why() -> None:
    outside = replace(a_change((-9.0, -1.0), after=30.0), searched_angles=(-0.5, 0.2))
    assert judged(a_diagnosis("arm_cable"), outside).verdict == "unknown"
    found = judged(a_diagnosis("arm_cable"), replace(outside, own_tail=a_change(tail=0.3)), lambda: 1.2)
    assert (found.verdict, found.confirmed, found.uncertain) == ("named", True, True)
    assert "leaves the angles of the searched ones (-0.5 to 0.2 rad)" in found.summary
    assert "Diagnose all logs together" in found.summary
    against = replace(outside, own_tail=a_change((-9.0, -1.0), tail=0.3))
    assert judged(a_diagnosis("arm_cable"), against).verdict == "unknown"


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
    assert gap.own_tail is not None
    assert not speaks_against(gap.own_tail, POLICY)
    assert judged(found, replace(gap, searched_angles=None)).verdict == "unknown"
    assert judged(found, gap).verdict == "named"
    assert gap.to_dict()["searched_angles"] == list(gap.searched_angles)
    bare = measure_gap(a_diagnosis(verdict="none"), HeldOut((searched,), (further,), POLICY))
    assert bare.to_dict()["searched_angles"] is None
