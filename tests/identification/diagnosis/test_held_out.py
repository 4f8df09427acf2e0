"""What data that no fit saw say about plants and effects: far, confirmed, denied."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from furuta_gym.plant import TABLE_3
from identification.diagnosis import held_out
from identification.diagnosis.held_out import HeldOut
from identification.kalman.noise import LostLog
from identification.validation.gap import Gap
from tests.factories import loop_log, made_log
from tests.identification.diagnosis.fits import POLICY, a_fit, a_gap, an_estimate

BARE, CABLE, DRIFT = a_fit(), a_fit("arm_spring"), a_fit("arm_friction_drift")


def _held(*gaps: tuple[Any, Gap | None], whole: bool = True) -> HeldOut:
    """Held-out data that know the gaps of fits; None: nobody can tell."""
    held = HeldOut((made_log(),), (made_log(),) if whole else (), POLICY)
    for fitted, gap in gaps:
        if gap is not None:
            held._known[id(fitted.plant)] = fitted.plant, gap
    return held


def _steady(times_floor: float, cost: float = 0.0, spread: float = 0.0) -> Gap:
    """Errors of so many times the floor, from one window to the next by some spread apart."""
    gap = a_gap(times_floor, cost)
    by_window = 1.0 + spread * np.where(np.arange(20) // 10 == 0, 1.0, -1.0)
    return replace(gap, errors=gap.errors * by_window[:, None])


@pytest.mark.parametrize(("times", "far"), [(1.4, False), (1.6, True)])
def test_far_is_an_error_well_above_the_floor(times: float, far: bool) -> None:
    assert _held((BARE, a_gap(times))).far(BARE) is far


@pytest.mark.parametrize(
    ("before", "after", "likelier", "confirmed"),
    [
        (5.0, 2.0, 200.0, True),
        (5.0, 5.5, 200.0, False),  # the error grows
        (5.0, 2.0, 5.0, False),  # no likelihood besides
        (5.0, 4.95, 200.0, False),  # for certain, but a share that nobody would miss
    ],
)
def test_an_effect_is_confirmed_by_error_likelihood_and_size(
    before: float, after: float, likelier: float, confirmed: bool
) -> None:
    held = _held((BARE, _steady(before, likelier)), (CABLE, _steady(after)))
    assert held.confirms(BARE, CABLE) is confirmed


def test_an_effect_that_helps_at_times_and_harms_at_times_is_not_confirmed() -> None:
    """Twice the error in one second, half of it in the next: on average less, for certain nothing."""
    held = _held((BARE, _steady(3.0, 200.0, -0.6)), (CABLE, _steady(2.8, 0.0, 0.6)))
    assert not held.confirms(BARE, CABLE)


@pytest.mark.parametrize(
    ("lost", "gained", "whole", "preferred"),
    [
        (5.0, 20.0, True, True),
        (50.0, 60.0, True, True),  # all data together are likelier
        (50.0, 40.0, True, False),
        (50.0, 60.0, False, False),  # the last part of a log is no further data
        (5.0, 20.0, False, True),
        (-30.0, 5.0, True, True),  # likelier on the fitted logs, and nearer on the others
        (4.0, 1.0, True, True),  # equals on the fitted logs: the error on the others decides
        (4.0, 1.0, False, False),
        (6.0, 1.0, True, False),
    ],
)
def test_another_fit_is_preferred_where_all_data_together_are_likelier(
    lost: float, gained: float, whole: bool, preferred: bool
) -> None:
    other = a_fit("arm_hysteresis", value=lost)
    held = _held((CABLE, _steady(5.0, gained)), (other, _steady(2.0)), whole=whole)
    assert held.prefers(CABLE, other) is preferred


def test_a_fit_that_predicts_no_better_is_not_preferred() -> None:
    other = a_fit("arm_hysteresis", value=-200.0)
    assert not _held((CABLE, _steady(5.0, 200.0)), (other, _steady(5.5))).prefers(CABLE, other)


@pytest.mark.parametrize(
    ("after", "likelier", "denied"), [(2.0, 200.0, False), (6.0, 200.0, True), (5.0, 200.0, True), (4.0, -50.0, False)]
)
def test_an_effect_is_denied_where_the_error_grows_or_nothing_closes(
    after: float, likelier: float, denied: bool
) -> None:
    assert _held((BARE, _steady(5.0, likelier)), (CABLE, _steady(after))).denies(BARE, CABLE) is denied


def test_another_log_says_nothing_of_what_follows_a_logs_own_clock() -> None:
    worse = (BARE, _steady(5.0)), (DRIFT, _steady(6.0))
    assert not _held(*worse).denies(BARE, DRIFT)
    assert _held(*worse, whole=False).denies(BARE, DRIFT)
    better = (BARE, _steady(5.0, 200.0)), (DRIFT, _steady(2.0))
    assert not _held(*better).confirms(BARE, DRIFT)
    assert _held(*better, whole=False).confirms(BARE, DRIFT)


def test_a_tail_needs_its_share_of_the_likelihood_only() -> None:
    """4 nats of the last three tenths are as much as 13 of the whole."""
    unsure = (BARE, _steady(5.0, 4.0, 0.5)), (CABLE, _steady(4.9, 0.0, -0.5))
    assert _held(*unsure).denies(BARE, CABLE)
    assert not _held(*unsure, whole=False).denies(BARE, CABLE)


@pytest.mark.parametrize("whole", [True, False])
def test_several_gaps_at_once_are_those_of_one_by_one(whole: bool) -> None:
    log, other = loop_log(duration=4.0)[0], loop_log(duration=4.0, seed=1)[0]
    plants = [TABLE_3, TABLE_3.replace(theta=1.3 * TABLE_3.theta)]
    single, together = (HeldOut((log,), (other,) if whole else (), POLICY) for _ in range(2))
    one_by_one = [single.gap(plant) for plant in plants]
    for alone, beside in zip(one_by_one, together.gaps(*((plant, None, None) for plant in plants)), strict=True):
        np.testing.assert_array_equal(alone.errors, beside.errors)
        np.testing.assert_array_equal(alone.floor, beside.floor)
    assert together.gap(plants[1]) is together.gaps((plants[1], None, None))[0]  # and they are kept


def test_where_nobody_can_tell_nothing_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    def too_short(*_: Any) -> Gap:
        raise ValueError("no log is long enough")

    monkeypatch.setattr(HeldOut, "_measured", too_short)
    held = _held()
    assert not held.far(BARE)
    assert not held.confirms(BARE, CABLE)
    assert not held.denies(BARE, CABLE)


def test_of_a_log_with_a_long_gap_the_last_part_is_one_of_its_samples() -> None:
    """Of 4 s, a quarter of an hour without samples, and 8 s, the last part begins within those 8 s."""
    log, plant = loop_log(duration=12.0)
    late = replace(log, t=np.where(log.t < 4.0, log.t, log.t + 900.0))
    gap = HeldOut((late,), (), POLICY).gap(plant)
    begins = late.t[round((1.0 - POLICY.tail) * len(log))]
    assert gap.times.min() - gap.horizon == pytest.approx(begins, abs=0.05)
    assert len(gap.times) > 0.9 * len(HeldOut((log,), (), POLICY).gap(plant).times)


@pytest.mark.parametrize(("hidden", "something_is_missing"), [(None, False), ("arm_spring", True)])
def test_a_fit_to_all_logs_tells_poor_parameters_from_another_rig(
    hidden: str | None, something_is_missing: bool
) -> None:
    """θ5 half as large: the held-out log mends it, unless a cable acts there, which no θ imitates."""
    fitted, held_out = loop_log(seed=1, duration=6.0)[0], loop_log(hidden, 3.0, seed=2, duration=6.0)[0]
    wrong = TABLE_3.replace(theta=TABLE_3.theta * [1.0, 1.0, 1.0, 1.0, 0.5, 1.0, 1.0, 1.0, 1.0])
    held = HeldOut((fitted,), (held_out,), POLICY)
    assert held.gap(wrong).ratio_to_floor > POLICY.far
    together = held.together(wrong)
    assert together is not None
    assert (together > POLICY.far) is something_is_missing
    assert HeldOut((fitted,), (), POLICY).together(wrong) is None


def test_the_last_part_of_a_log_is_measured_by_its_own_floor(monkeypatch: pytest.MonkeyPatch) -> None:
    """A pendulum that falls late has another floor then."""
    log, plant = made_log(), TABLE_3
    whole = a_gap()
    late = whole.times >= np.quantile(whole.times, 0.5)
    floors = np.where(late[:, None], 4.0 * whole.floors, whole.floors)
    gap = replace(whole, floors=floors, reading_floors=0.5 * floors, errors=2.0 * whole.errors)
    monkeypatch.setattr(held_out, "validate", lambda *_, **__: gap)
    monkeypatch.setattr(held_out, "_cut", lambda *_: whole.times[late].min() - whole.horizon)
    found = held_out._of_tails(plant, [log], 0.5)
    assert found.ratio_to_floor == pytest.approx(1.0)
    assert found.torque_share == pytest.approx([0.5, 0.5])


def test_logs_that_no_common_plant_can_be_measured_on_have_no_fit_to_all(monkeypatch: pytest.MonkeyPatch) -> None:
    def too_short(*_: Any) -> Gap:
        raise ValueError("no log is long enough")

    monkeypatch.setattr(held_out, "identify", lambda *_, **__: an_estimate(TABLE_3))
    monkeypatch.setattr(held_out, "validate", too_short)
    assert _held().together(TABLE_3) is None


def test_what_only_the_last_part_shows_is_not_checked_by_it() -> None:
    """A mass that falls after 85 % of the log: the first 70 % would keep its fitted size, and predict the rest."""
    log, truth = loop_log("payload_step", duration=8.0, T=0.004)
    (mass,) = truth.effects
    late = truth.with_effects(replace(mass, parameters={**mass.parameters, "t0": 0.85 * 8.0}))
    held = HeldOut((log,), (), POLICY)
    with pytest.raises(ValueError, match="do not show payload_step"):
        held.gap(late)
    with pytest.raises(ValueError, match="do not show payload_step"):  # and no second fit for that
        held.gap(late)


def test_what_repeats_by_its_clock_is_judged_by_the_last_parts_of_its_own_logs() -> None:
    """Another log has another phase; the last three tenths of the searched log have the same."""
    periodic = a_fit("periodic_torque")
    for after, denied in ((2.0, False), (6.0, True)):
        held = _held((BARE, _steady(5.0)), (periodic, _steady(6.0)))
        for fitted, gap in ((BARE, _steady(5.0, 200.0)), (periodic, _steady(after))):
            held._own_tails._known[id(fitted.plant)] = fitted.plant, gap
        assert held.denies(BARE, periodic) is denied
        assert not held.excuses(BARE, periodic)
    assert not _held((BARE, _steady(5.0)), (DRIFT, _steady(6.0))).denies(BARE, DRIFT)  # and a drift not at all


@pytest.mark.parametrize(("without", "within", "denied"), [(None, "lost", True), ("lost", "lost", False)])
def test_a_name_with_which_alone_the_logs_are_lost_is_denied(without: Any, within: Any, denied: bool) -> None:
    held = _held()
    for fitted, gap in ((BARE, without), (CABLE, within)):
        held._known[id(fitted.plant)] = fitted.plant, LostLog("lost") if gap == "lost" else _steady(5.0)
    assert held.denies(BARE, CABLE) is denied
    held._known[id(CABLE.plant)] = CABLE.plant, ValueError("too short")
    assert not held.denies(BARE, CABLE)


@pytest.mark.parametrize(
    ("gain", "times", "excused"), [(250.0, 1.0, True), (150.0, 1.0, False), (250.0, 1.6, False), (None, 1.0, True)]
)
def test_other_angles_excuse_what_gains_more_on_all_logs_than_on_the_searched(
    monkeypatch: pytest.MonkeyPatch, gain: float | None, times: float, excused: bool
) -> None:
    """200 nats on the searched log. What imitates something there gains less where it must serve other angles too."""
    cable = a_fit("arm_spring", value=-200.0)
    held = _held((BARE, _steady(5.0)), (cable, _steady(6.0)))
    monkeypatch.setattr(HeldOut, "searched_angles", lambda *_: (-0.3, 0.3))
    said = {"arm_spring": (SimpleNamespace(log_likelihood=1000.0 + (gain or 0.0)), times)}
    bare = None if gain is None else (SimpleNamespace(log_likelihood=1000.0), 5.0)
    monkeypatch.setattr(HeldOut, "jointly", lambda _, plant: said.get("arm_spring") if plant.effects else bare)
    assert held.excuses(BARE, cable) is excused
    free = {True: SimpleNamespace(log_likelihood=300.0), False: SimpleNamespace(log_likelihood=0.0)}
    monkeypatch.setattr(HeldOut, "_free", lambda _, plant, *__: free[bool(plant.effects)])  # 300 nats without a prior
    assert held.excuses(BARE, cable) is (excused and gain is None)
    monkeypatch.setattr(HeldOut, "searched_angles", lambda *_: None)
    assert not held.excuses(BARE, cable)


def test_the_mirror_of_a_lost_log_confirms_and_is_far() -> None:
    held = _held((CABLE, _steady(1.0)))
    held._known[id(BARE.plant)] = BARE.plant, LostLog("lost")
    assert held.confirms(BARE, CABLE)
    assert held.far(BARE)
    assert held.off(BARE)
    assert not held.far(CABLE)


def test_a_fit_that_the_prior_costs_next_to_nothing_is_asked_once(monkeypatch: pytest.MonkeyPatch) -> None:
    for strain, ratio in ((1.0, 35.0), (50.0, 1.0)):
        held = _gaps_of(monkeypatch, 35.0, 1.0)
        assert held.gap(BARE.plant, BARE.noise, {}, strain).ratio_to_floor == pytest.approx(ratio)


def _gaps_of(monkeypatch: pytest.MonkeyPatch, first: Any, free: Any) -> HeldOut:
    """Held-out data on which the search's fit has one gap, and the fit without a prior another."""
    bare = TABLE_3.replace(u_max=123.0)

    def validated(plant: Any, _: Any) -> Gap:
        found = free if plant is bare else first
        if isinstance(found, ValueError):
            raise found
        return _steady(found)

    monkeypatch.setattr(held_out, "validate", validated)
    monkeypatch.setattr(HeldOut, "_refitted", staticmethod(lambda *_: SimpleNamespace(plant=bare)))
    return _held()


@pytest.mark.parametrize(
    ("first", "free", "ratio"),
    [
        (1.05, 9.0, 1.05),  # adequate: no second fit
        (35.0, 1.0, 1.0),
        (35.0, 40.0, 35.0),
        (LostLog("lost"), 1.0, 1.0),
        (35.0, ValueError("too short"), 35.0),
    ],
)
def test_a_fit_that_predicts_poorly_is_asked_without_its_prior(
    monkeypatch: pytest.MonkeyPatch, first: Any, free: Any, ratio: float
) -> None:
    held = _gaps_of(monkeypatch, first, free)
    assert held.gap(BARE.plant, BARE.noise, {}).ratio_to_floor == pytest.approx(ratio)
    alone = _gaps_of(monkeypatch, first, free)  # an estimate has no prior
    if isinstance(first, LostLog):
        with pytest.raises(LostLog):
            alone.gap(BARE.plant)
    else:
        assert alone.gap(BARE.plant).ratio_to_floor == pytest.approx(first)
