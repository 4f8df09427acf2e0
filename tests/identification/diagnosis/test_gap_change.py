"""A gap by its logs and by their kinds of experiment: what is pooled hides which prediction got worse."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from identification.diagnosis.gap_change import GapChange, closes, rms_interval, speaks_against
from identification.diagnosis.policy import DecisionPolicy
from identification.logs.log import Log
from identification.validation.closed_fraction import closed_fraction
from identification.validation.gap import Gap
from tests.factories import made_log
from tests.identification.diagnosis.fits import a_gap

HANGING, TURNS = (0.9 * math.pi, 1.1 * math.pi), (0.0, math.pi)
FLOOR = 0.01  # rad, of `a_gap`
SURPRISE = np.zeros((1, 3))  # as likely with as without


def a_log(source: str, low: float, high: float) -> Log:
    return made_log(q2=np.linspace(low, high, 200), source=source)


LOGS = (a_log("chirp", *HANGING), a_log("swing-up", *TURNS), a_log("another chirp", *HANGING))


def _gap(*times_floor: float) -> Gap:
    """Errors of so many times the floor in each log, twenty windows a log."""
    errors = np.repeat(FLOOR * np.array(times_floor), 20)[:, None] * [1.0, 1.0]
    number = np.repeat(np.arange(len(times_floor)), 20)
    rms = np.sqrt(np.mean(errors**2, axis=0))
    floors = np.full((len(errors), 2), FLOOR**2)
    windows = {"floors": floors, "reading_floors": floors, "times": np.tile(np.arange(20) * 0.1, len(times_floor))}
    return replace(a_gap(), rms=rms, errors=errors, log=number, **windows)


def _change(before: Gap, after: Gap) -> GapChange:
    return GapChange(before, after, closed_fraction(before, after), LOGS, None)


@pytest.fixture
def change() -> GapChange:
    """Chirps from 5 and 3 times the floor to 1.5 times; the swing-up from 20 to 21 times."""
    return _change(_gap(5.0, 20.0, 3.0), _gap(1.5, 21.0, 1.5))


def test_every_log_has_its_own_error(change: GapChange) -> None:
    assert [part.name for part in change.by_log] == ["chirp", "swing-up", "another chirp"]
    ratios = [part.over_floor for part in change.by_log]
    assert ratios == [pytest.approx(r) for r in ((5.0, 1.5), (20.0, 21.0), (3.0, 1.5))]
    for part, (before, after) in zip(change.by_log, ratios, strict=True):
        assert part.closed.value == pytest.approx((before**2 - after**2) / (before**2 - 1.0))
        np.testing.assert_allclose(part.rms_after, FLOOR * after)


def test_kinds_of_experiment_are_told_apart(change: GapChange) -> None:
    """Pooled, the swing-up would be all that counts; and a chirp would hide that it is predicted worse."""
    hanging, turns = change.by_kind
    assert (hanging.name, hanging.logs) == ("hanging", 2)
    assert (turns.name, turns.logs) == ("whole turns", 1)
    assert hanging.over_floor == pytest.approx((math.sqrt((5.0**2 + 3.0**2) / 2), 1.5))
    assert turns.over_floor == pytest.approx((20.0, 21.0))
    assert not hanging.grows
    assert turns.grows
    assert hanging.closed.value > 0.9
    assert abs(change.closed.value) < 0.1  # pooled: nothing changes


def test_what_is_written_has_every_log_and_kind(change: GapChange) -> None:
    told = change.to_dict()
    assert [part["name"] for part in told["by_log"]] == ["chirp", "swing-up", "another chirp"]
    assert [(part["name"], part["logs"]) for part in told["by_kind"]] == [("hanging", 2), ("whole turns", 1)]
    assert told["by_kind"][1]["ratio_to_floor"] == pytest.approx([20.0, 21.0])
    assert told["by_kind"][1]["closed_interval"][1] < 0.0


def test_both_sides_are_measured_by_the_floor_of_the_better_plant() -> None:
    """What a wrong plant misses grows from run to run and passes for their spread: its floor excuses it."""
    before = _gap(5.0, 5.0, 5.0)
    before = replace(before, floor=np.full(2, 4.0 * FLOOR), floors=16.0 * before.floors)
    change = _change(before, _gap(1.5, 1.5, 1.5))
    assert change.over_floor(change.before) == pytest.approx(5.0)
    assert change.over_floor(change.after) == pytest.approx(1.5)
    for part in change.by_log:
        assert part.over_floor == pytest.approx((5.0, 1.5))
    assert change.closed.value == pytest.approx((5.0**2 - 1.5**2) / (5.0**2 - 1.0))


@pytest.mark.parametrize(("seconds", "certain"), [(0.9, False), (2.0, True), (20.0, True)])
@pytest.mark.parametrize("after", [1.5, 6.0])
def test_windows_of_one_moment_make_nothing_certain(seconds: float, certain: bool, after: float) -> None:
    """Every draw of a bootstrap over one block is the same: an interval of no width would be a verdict."""

    def within(gap: Gap) -> Gap:
        return replace(gap, times=np.linspace(2.0, 2.0 + seconds, len(gap.times), endpoint=False), surprise=SURPRISE)

    change = _change(within(_gap(5.0)), within(_gap(after)))
    low, high = change.closed.interval
    (part,) = change.by_log
    if certain:
        assert low <= change.closed.value <= high
        assert closes(change, DecisionPolicy()) == (after < 5.0)
        assert part.grows == (after > 5.0)
        assert rms_interval(change.after) is not None
    else:
        assert math.isnan(low)
        assert math.isnan(high)
        assert not closes(change, DecisionPolicy())
        assert not part.grows
        assert rms_interval(change.after) is None
        assert "too few windows" in str(change.closed)
    assert speaks_against(change, DecisionPolicy()) == (not certain or after > 5.0)
    assert change.to_dict()["closed_interval"] == pytest.approx([low, high], nan_ok=True)


def test_the_last_part_of_a_log_speaks_by_its_share_of_the_evidence(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ten nats confirm a name on other logs, and three on three tenths of its own."""
    change = replace(_change(_gap(1.0), _gap(1.0)), tail=None)
    for nats, whole, tail in ((2.0, True, True), (6.0, True, False), (11.0, False, False)):
        monkeypatch.setattr(GapChange, "likelier", property(lambda _, nats=nats: nats))
        assert speaks_against(change, DecisionPolicy()) is whole
        assert speaks_against(replace(change, tail=0.3), DecisionPolicy()) is tail


def test_a_quiet_log_is_measured_by_its_own_floor() -> None:
    """Two chirps at a floor ten times that of the swing-up, whose error falls from ten to five times its own."""

    def quiet_in_the_middle(gap: Gap, times_floor: float) -> Gap:
        quiet = gap.log == 1
        errors, floors = gap.errors.copy(), gap.floors.copy()
        errors[quiet], floors[quiet] = times_floor * 0.1 * FLOOR, (0.1 * FLOOR) ** 2
        pooled = (np.sqrt(np.mean(x, axis=0)) for x in (errors**2, floors))
        return replace(gap, errors=errors, floors=floors, **dict(zip(("rms", "floor"), pooled, strict=True)))

    change = _change(quiet_in_the_middle(_gap(1.0, 1.0, 1.0), 10.0), quiet_in_the_middle(_gap(1.0, 1.0, 1.0), 5.0))
    hanging, turns = change.by_kind
    assert hanging.over_floor == pytest.approx((1.0, 1.0))
    assert turns.over_floor == pytest.approx((10.0, 5.0))
    assert turns.closed.value == pytest.approx((10.0**2 - 5.0**2) / (10.0**2 - 1.0))
    assert change.by_log[1].over_floor == pytest.approx((10.0, 5.0))


def test_a_zero_of_the_arm_that_only_one_side_estimates_has_its_price(change: GapChange) -> None:
    """A cable frees the arm's zero in every held-out log; model (5) has none to free."""
    rows = np.column_stack([np.repeat([0.0, 1.0], 400), np.tile(np.arange(400) * 0.01, 2), np.ones(800)])
    before = replace(change.before, surprise=rows, zeros={0: (0.0, 1e-3), 1: (0.0, 2e-3)})
    after = replace(change.after, surprise=rows, zeros={0: (0.1, 1e-3), 1: (-0.2, 2e-3)})
    price = 2 * 0.5 * math.log(400)
    assert replace(change, before=before, after=after).likelier == pytest.approx(-price)
    assert replace(change, before=after, after=before).likelier == pytest.approx(price)
    assert replace(change, before=after, after=after).likelier == 0.0
