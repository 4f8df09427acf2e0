"""The bristle of an arm that gives before it slides: stable at any stiffness, and along its way as Dahl has it."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from furuta_gym.plant import EFFECTS, LARGE_RIG, TABLE_3, Effect
from tests.furuta_gym.plant.helpers import run

TH = LARGE_RIG.theta


@pytest.mark.parametrize("speed", [3.0, 10.0, 25.0])
@pytest.mark.parametrize("stiffness", [1e2, 3e2, 1e3, 1e4, 1e6])
@pytest.mark.parametrize("i", [0.0, 0.5, 1.0])
def test_a_stiff_bristle_stays_stable_and_becomes_coulomb(i, stiffness, speed):
    """σ0 → ∞ is rigid friction; no stiffness may blow up the usual step (ż relaxes at σ0 |v1| / θ8)."""
    plant = TABLE_3.with_effects(Effect("arm_presliding", {"σ0": stiffness * TABLE_3.theta[7], "i": i}))
    x0, t_u, none = [0.0, 0.1, speed, 0.0], np.arange(25) * 0.004, np.zeros(25)
    bristle = run(plant, x0, t_u, none, 0.1, 1e-3)
    np.testing.assert_allclose(bristle[:, :4], run(TABLE_3, x0, t_u, none, 0.1, 1e-3), atol=5e-3)


@pytest.mark.parametrize("speed", [1.0, 5.0, 20.0])
@pytest.mark.parametrize("stiffness", [100.0, 300.0, 1000.0])
@pytest.mark.parametrize("i", [0.0, 0.5, 1.0, 1.5, 2.0])
def test_a_bristle_comes_back_to_its_end_value(i, stiffness, speed):
    """At the longest step that environments take, 2.5 ms, after a reversal and the overshoot of a first step."""
    kernel = EFFECTS["arm_presliding"].kernels["rate"]
    z, h = -1.0 / stiffness, 2.5e-3  # of θ8 = 1

    def rate(z):
        return kernel(v1=speed, theta8=1.0, σ0=stiffness, i=i, z=z)

    for _ in range(400):
        k1 = rate(z)
        k2 = rate(z + 0.5 * h * k1)
        k3 = rate(z + 0.5 * h * k2)
        z += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + rate(z + h * k3))
    assert stiffness * z <= 1.0 + 1e-6
    assert stiffness * z > 0.9


@pytest.mark.parametrize("i", [0.0, 0.3, 0.5, 1.0, 1.5, 2.0])
def test_a_bristle_yields_along_its_way_as_dahl_has_it(i):
    """Moved one way from rest, (1 − σ0 z / θ8)^(1 − i) falls linearly with the way: an element that slips at θ8 / σ0
    for i = 0, an exponential for i = 1."""
    plant = LARGE_RIG.with_effects(Effect("arm_presliding", {"σ0": 20.0 * TH[7], "i": i}))
    effect, speed, ways = plant.effects[0], 0.5, np.linspace(0.0, 0.2, 41)
    kernel = effect.type.kernels["rate"]

    def rate(t, z):
        return kernel(v1=speed, theta8=TH[7], z=z[0], **effect.parameters)

    z = solve_ivp(rate, (0.0, ways[-1] / speed), [0.0], t_eval=ways / speed, max_step=1e-3, rtol=1e-8, atol=1e-10).y[0]
    left = np.exp(-20.0 * ways) if i == 1.0 else np.maximum(1.0 - (1.0 - i) * 20.0 * ways, 0.0) ** (1.0 / (1.0 - i))
    np.testing.assert_allclose(20.0 * z, 1.0 - left, atol=0.02)
