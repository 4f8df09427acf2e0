"""What a fit of a search says of itself."""

from __future__ import annotations

import numpy as np
import pytest

from furuta_gym.plant import TABLE_3
from identification.diagnosis.naming.fits import Fit, anchored
from identification.estimation.optimise import Expansion, Optimum
from identification.kalman.coordinates import plant_coordinates
from identification.kalman.noise_model import Noise


@pytest.mark.parametrize(("moved", "nats"), [({}, 0.0), ({"theta4": 1.0}, 0.5), ({"theta1": 2.0, "theta9": 5.0}, 2.0)])
def test_the_prior_on_theta_pulls_by_how_far_the_optimum_is_from_the_anchor(
    moved: dict[str, float], nats: float
) -> None:
    """In its standard deviations; friction has no such prior."""
    coordinates = [anchored(c, TABLE_3, 1.5) for c in plant_coordinates(TABLE_3)]
    z = np.array([c.to_z(TABLE_3.packed().p[c.row]) for c in coordinates])
    z += [1.5 * moved.get(c.name, 0.0) for c in coordinates]
    optimum = Optimum(z, 0.0, Expansion(0.0, z, np.eye(len(z))), 1, True, "converged")
    assert Fit(TABLE_3, Noise(np.array([1e-6, 1e-8])), tuple(coordinates), optimum, ()).pull == pytest.approx(nats)
