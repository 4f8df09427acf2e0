"""When held-out data take a name back."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from experiments.report.gap import TAIL, _of_tails, brings_nothing, judged
from furuta_gym.plant import TABLE_3
from tests.identification.loops import loop_log


@pytest.mark.parametrize(
    ("closed", "likelier", "timed", "tail", "changed", "nothing"),
    [
        ((0.3, 1.0), 0.0, False, None, True, False),
        ((-0.2, 1.0), 0.0, False, None, True, True),
        ((-0.2, 1.0), 9.0, False, None, True, True),
        ((-0.2, 1.0), 40.0, False, None, True, False),  # the gap is lost in noise, the likelihood is not
        ((math.nan, math.nan), 0.0, False, None, True, True),
        ((math.nan, math.nan), 40.0, False, None, True, False),
        ((-1.2, -0.3), 40.0, False, None, True, True),  # likelier by a step, farther off over a horizon
        ((-0.2, 1.0), 0.0, True, None, True, False),  # a drift starts anew in another log
        ((-0.2, 1.0), 0.0, True, 0.3, True, True),
        ((0.0, 0.0), 0.0, False, None, False, False),  # no effect was found
    ],
)
def test_a_name_that_closes_nothing_is_taken_back(
    closed: tuple[float, float], likelier: float, timed: bool, tail: float | None, changed: bool, nothing: bool
) -> None:
    gap: Any = SimpleNamespace(changed=changed, closed=SimpleNamespace(interval=closed), tail=tail, likelier=likelier)
    diagnosis: Any = SimpleNamespace(timed=timed)
    assert brings_nothing(diagnosis, gap) is nothing


@pytest.mark.parametrize(("after", "timed", "told"), [(1.2, False, None), (1.8, False, "short 1.8"), (1.8, True, None)])
def test_what_names_leave_of_the_gap_is_told(after: float, timed: bool, told: str | None) -> None:
    closed = SimpleNamespace(interval=(0.3, 0.9))
    gap: Any = SimpleNamespace(changed=True, closed=closed, tail=None, likelier=500.0, after_over_floor=after)
    diagnosis: Any = SimpleNamespace(timed=timed, falling_short=lambda ratio: f"short {ratio}")
    assert judged(diagnosis, gap) == (told or diagnosis)


def test_the_likelihood_of_a_tail_is_the_tails() -> None:
    """What was fitted must not vouch for itself."""
    log = loop_log(duration=12.0)[0]
    tail = _of_tails(TABLE_3, [log])
    cut = log.t[0] + (1.0 - TAIL) * log.duration
    assert tail.surprise[:, 1].min() >= cut
    assert tail.surprise[:, 1].max() > log.t[-1] - 0.1
