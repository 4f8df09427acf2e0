"""What an error over the noise floor says of a plant."""

from __future__ import annotations

import pytest

from identification.validation.adequacy import Adequacy, Judgement


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
