"""r on fast swings of another simulator: an error of integration in the filters would leave it far off."""

import pytest

from experiments.studies.sharpness import errors, swept
from identification.estimation.identify import identify


@pytest.mark.parametrize("seed", [1, 2, 3, 7])
def test_r_is_within_three_standard_deviations(seed):
    z = errors(seed)
    assert "r" in z
    assert len(z) >= 8  # what is not identified would say nothing
    assert max(abs(value) for value in z.values()) < 3.0


def test_a_pendulum_that_turns_over_is_told_as_such():
    """Its log is refused, and not for its signs."""
    with pytest.raises(ValueError, match="turns over again and again"):
        identify(swept(4)[0])
