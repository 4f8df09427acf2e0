"""When held-out data take a name back."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from experiments.report.gap import brings_nothing, judged


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
