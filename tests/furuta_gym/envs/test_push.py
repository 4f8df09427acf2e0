"""A push is an impulse on the pendulum alone."""

from __future__ import annotations

import numpy as np
import pytest

from furuta_gym.envs import kernels as k
from furuta_gym.plant import QUBE


def test_a_push_is_an_impulse_on_the_pendulum_alone() -> None:
    """q̇2 changes by the push, and q̇1 so that the arm's row of M Δq̇ stays zero."""
    lanes_n, rows = 400, 4
    rng = np.random.default_rng(0)
    lanes = np.zeros((k.N_FIXED + rows + 11, lanes_n))
    lanes[k.N_FIXED : k.N_FIXED + 4] = rng.normal(size=(4, lanes_n))
    lanes[k.N_FIXED + rows : k.N_FIXED + rows + 9] = QUBE.theta[:, None]
    lanes[k.PUSH], lanes[k.PUSH_RATE] = 5.0, 20.0
    lanes[k.DONE, ::2] = 1.0
    sizes = np.zeros(k.N_SIZES, dtype=np.int64)
    sizes[k.STATE_ROWS] = rows
    before = lanes.copy()
    k._push(lanes, rng.integers(2**64 - 1, size=lanes_n, dtype=np.uint64), sizes, 0.025)  # with a chance of one half
    dv1, dv2 = (lanes - before)[k.N_FIXED + 2 : k.N_FIXED + 4]
    hit, q2 = dv2 != 0.0, before[k.N_FIXED + 1]
    assert not hit[::2].any()
    assert 0.4 < hit[1::2].mean() < 0.6
    assert np.abs(dv2[hit]) == pytest.approx(5.0)
    assert 0.35 < (dv2[hit] > 0).mean() < 0.65
    m11 = QUBE.theta[0] + QUBE.theta[1] * np.sin(q2) ** 2
    assert m11 * dv1 + QUBE.theta[2] * np.cos(q2) * dv2 == pytest.approx(0.0, abs=1e-12)
