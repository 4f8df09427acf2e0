"""What kind of experiment a log is."""

from __future__ import annotations

import math

import numpy as np
import pytest

from identification.logs.kind import kind_of
from tests.factories import made_log


@pytest.mark.parametrize(
    ("low", "high", "kind"),
    [
        (-0.2, 0.3, "upright"),
        (math.pi - 1.0, math.pi + 1.2, "hanging"),
        (math.pi - 2.0, math.pi + 2.0, "hanging"),  # above the horizontal, not near the top
        (3 * math.pi - 1.0, 3 * math.pi, "hanging"),
        (0.0, math.pi, "whole turns"),
        (-20.0, 20.0, "whole turns"),
    ],
)
def test_the_kind_is_where_the_pendulum_goes(low: float, high: float, kind: str) -> None:
    assert kind_of(made_log(q2=np.linspace(low, high, 200))) == kind
