"""Plants that the controllers are tried on."""

import pytest

from furuta_gym.plant import PLANTS, Plant


@pytest.fixture(params=list(PLANTS))
def plant(request: pytest.FixtureRequest) -> Plant:
    """Table 3 and the two consistent rigs, in turn."""
    return PLANTS[request.param]
