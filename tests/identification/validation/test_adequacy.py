"""What an error over the noise floor says of a plant."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.validation.adequacy import Adequacy, Judgement
from tests.identification.diagnosis.fits import a_gap


@pytest.mark.parametrize(
    ("ratio", "torque", "adequacy", "in_doubt"),
    [
        (1.0, 0.5, Adequacy.ADEQUATE, False),
        (1.09, 0.5, Adequacy.ADEQUATE, False),
        (1.11, 0.5, Adequacy.SMALL, False),
        (1.99, 0.5, Adequacy.SMALL, False),
        (2.01, 0.5, Adequacy.INADEQUATE, False),
        (0.76, 0.5, Adequacy.ADEQUATE, False),
        (0.74, 0.5, Adequacy.UNKNOWN, True),  # no plant is better than its floor
        (1.0, 0.94, Adequacy.ADEQUATE, False),
        (1.0, 0.96, Adequacy.UNKNOWN, True),  # what a plant misses raises such a floor
        (1.9, 0.96, Adequacy.UNKNOWN, True),
        (3.0, 0.96, Adequacy.INADEQUATE, True),
    ],
)
def test_a_plant_is_judged_by_its_error_and_by_its_floor(
    ratio: float, torque: float, adequacy: Adequacy, in_doubt: bool
) -> None:
    judged = Judgement.of(ratio, torque)
    assert judged.adequacy is adequacy
    assert judged.floor_in_doubt is in_doubt


@pytest.mark.parametrize(("adequate", "there"), [(1.1, False), (1.3, True)])
def test_what_is_called_adequate_says_whether_an_error_is_at_the_floor(adequate: float, there: bool) -> None:
    gap = replace(a_gap(), rms=np.array([1.2, 1.2]), floor=np.ones(2), reading_floor=np.ones(2))
    assert gap.at_the_floor(adequate) is there


def test_a_floor_far_above_the_errors_is_no_measure() -> None:
    """As of a plant that the filter hardly follows: its floor says nothing, and neither does a ratio to it."""
    gap = replace(a_gap(), rms=np.array([0.9, 1.7]), floor=np.array([1e5, 1e5]), reading_floor=np.array([3e2, 3e2]))
    assert gap.verdict.startswith("below the floor")
    assert "too large" not in gap.verdict


def test_large_errors_are_printed_as_people_write_them() -> None:
    gap = replace(a_gap(), rms=np.array([1.61, 0.0123]), fit_percent=np.array([-13156.8, -51.7]))
    said = str(gap)
    assert "q1  rms 1610 mrad" in said
    assert "fit below -100 %" in said
    assert "q2  rms 12.3 mrad" in said
    assert "fit -51.7 %" in said
