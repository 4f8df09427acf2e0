"""When held-out data take a name back."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from furuta_gym.plant import TABLE_3
from identification.diagnosis.naming.forward import START_NOISE
from identification.diagnosis.naming.scores import fit
from identification.diagnosis.verify import LIKELIER, TAIL, _of_tails, brings_nothing, judged, measure_gap
from identification.kalman.record import Record
from tests.factories import loop_log


def change(closed: tuple[float, float] = (0.3, 0.9), likelier: float = 500.0, **more: Any) -> Any:
    usual = {"changed": True, "tail": None, "own_tail": None, "after_over_floor": 1.0}
    return SimpleNamespace(closed=SimpleNamespace(interval=closed), likelier=likelier, **(usual | more))


def diagnosis(timed: bool = False) -> Any:
    return SimpleNamespace(timed=timed, vetoed=lambda: "vetoed", falling_short=lambda ratio: f"short {ratio}")


@pytest.mark.parametrize(
    ("closed", "likelier", "changed", "nothing"),
    [
        ((0.3, 1.0), 0.0, True, False),
        ((-0.2, 1.0), 0.0, True, True),
        ((-0.2, 1.0), 9.0, True, True),
        ((-0.2, 1.0), 40.0, True, False),  # the gap is lost in noise, the likelihood is not
        ((math.nan, math.nan), 0.0, True, True),
        ((math.nan, math.nan), 40.0, True, False),
        ((-1.2, -0.3), 40.0, True, True),  # likelier by a step, farther off over a horizon
        ((0.0, 0.0), 0.0, False, False),  # no effect was found
    ],
)
def test_a_name_that_closes_nothing_is_taken_back(
    closed: tuple[float, float], likelier: float, changed: bool, nothing: bool
) -> None:
    gap = change(closed, likelier, changed=changed)
    assert brings_nothing(gap) is nothing
    found = diagnosis()
    assert judged(found, gap) == ("vetoed" if nothing else found)


@pytest.mark.parametrize(("after", "told"), [(1.2, None), (1.8, "short 1.8")])
def test_what_names_leave_of_the_gap_is_told(after: float, told: str | None) -> None:
    found = diagnosis()
    assert judged(found, change(after_over_floor=after)) == (told or found)


def test_what_follows_a_logs_own_clock_is_judged_on_its_tail_only() -> None:
    """A drift starts anew in another log; what repeats must go on in the rest of its own."""
    found, useless = diagnosis(timed=True), {"closed": (-0.2, 1.0), "likelier": 0.0}
    assert judged(found, change(**useless, after_over_floor=9.0)) == found
    assert judged(found, change(**useless, tail=TAIL)) == "vetoed"
    assert judged(found, change(own_tail=change(**useless, tail=TAIL))) == "vetoed"
    assert judged(found, change(**useless, own_tail=change(tail=TAIL))) == found
    assert judged(found, change(own_tail=change(tail=TAIL, after_over_floor=1.8))) == "short 1.8"


def test_the_likelihood_of_a_tail_is_the_tails() -> None:
    """What was fitted must not vouch for itself."""
    log = loop_log(duration=12.0)[0]
    tail = _of_tails(TABLE_3, [log])
    cut = log.t[0] + (1.0 - TAIL) * log.duration
    assert tail.surprise[:, 1].min() >= cut
    assert tail.surprise[:, 1].max() > log.t[-1] - 0.1


def test_a_small_torque_that_repeats_is_seen_to_go_on_in_the_tail() -> None:
    """The refit to the first part of the log must not lose it again in the noise that it starts from."""
    log, truth = loop_log("periodic_torque", 0.2, duration=12.0)
    final = fit(truth, START_NOISE, [Record.from_log(log)], anchor=TABLE_3)
    found: Any = SimpleNamespace(
        before=SimpleNamespace(plant=TABLE_3),
        after=SimpleNamespace(plant=final.plant),
        naming=SimpleNamespace(final=final),
        repeating=True,
    )
    gap = measure_gap(found, [log])
    assert gap.likelier > LIKELIER
    assert not brings_nothing(gap)
    other, _ = loop_log("periodic_torque", 0.2, duration=12.0, seed=5)
    both = measure_gap(found, [log], [other])
    assert both.own_tail is not None
    assert both.own_tail.likelier == pytest.approx(gap.likelier)
    assert both.to_dict()["own_tail"]["tail"] == TAIL
