"""When held-out data take a name back."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from experiments.report.gap import brings_nothing


@pytest.mark.parametrize(
    ("low", "timed", "tail", "changed", "nothing"),
    [
        (0.3, False, None, True, False),
        (-0.2, False, None, True, True),
        (-0.2, True, None, True, False),  # a drift starts anew in another log
        (-0.2, True, 0.3, True, True),
        (0.0, False, None, False, False),  # no effect was found
    ],
)
def test_a_name_that_closes_nothing_is_taken_back(
    low: float, timed: bool, tail: float | None, changed: bool, nothing: bool
) -> None:
    gap: Any = SimpleNamespace(changed=changed, closed=SimpleNamespace(interval=(low, 1.0)), tail=tail)
    diagnosis: Any = SimpleNamespace(timed=timed)
    assert brings_nothing(diagnosis, gap) is nothing
