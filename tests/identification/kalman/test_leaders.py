"""Covariances of filters side by side, against one filter at a time, for states that are written out and for others."""

from __future__ import annotations

import numpy as np
import pytest

from furuta_gym.plant import TABLE_3
from furuta_gym.plant.dynamics import mass_matrix
from identification.kalman.arguments import LeaderReadings
from identification.kalman.leaders import step_leaders
from identification.kalman.one_filter import add_torque_noise, read_pair

QUANTUM = np.array([0.05, 0.0])
NOISE = np.array([0.3, 0.4, 0.02, 0.03])  # intensities of torques, variances of readings
T = 0.01  # s


def _covariances(n: int, L: int) -> np.ndarray:
    rng = np.random.default_rng(n)
    root = rng.normal(size=(L, n, n))
    return root @ root.transpose(0, 2, 1)


def _packed(C: np.ndarray) -> np.ndarray:
    rows, columns = np.tril_indices(C.shape[1])
    return np.ascontiguousarray(C[:, rows, columns].T)


@pytest.mark.parametrize("L", [1, 4, 8, 19])
@pytest.mark.parametrize("direct", [True, False])
@pytest.mark.parametrize("n", [4, 5, 6, 8])
def test_a_step_is_that_of_one_filter_at_a_time(n: int, direct: bool, L: int) -> None:
    rng = np.random.default_rng(1)
    C, Phi = _covariances(n, L), rng.normal(size=(n, n, L))
    H = np.zeros((2, n))
    H[0, 0] = H[1, 1] = 1.0
    if not direct:
        H += 0.1 * rng.normal(size=H.shape)
    q2, d = np.linspace(-1.0, 2.0, L), rng.normal(size=(2, L))
    theta = TABLE_3.theta[:4, None] * rng.uniform(0.9, 1.1, (4, L))
    noise = NOISE[:, None] * rng.uniform(0.5, 2.0, (4, L))
    packed, told = _packed(C), LeaderReadings.empty(n, L)
    every = np.repeat(H[:, :, None], L, axis=2)
    step_leaders(packed, Phi, q2, theta, T, every, direct, noise, d, QUANTUM, told, np.empty((n, n, L)))
    for g in range(L):
        one = Phi[:, :, g] @ C[g] @ Phi[:, :, g].T
        add_torque_noise(one, q2[g], theta[:, g], noise[:, g], T)
        K, e, S, prior = np.empty((n, 2)), np.empty(2), np.empty(3), np.empty(2)
        cost = read_pair(one, H, noise[:, g], d[:, g].copy(), QUANTUM, K, e, S, prior, np.empty(n))
        np.testing.assert_allclose(told.K[:, :, g], K.T, rtol=1e-9, atol=1e-11)
        np.testing.assert_allclose(told.e[:, g], e, rtol=1e-9)
        np.testing.assert_allclose(told.S[:, g], S, rtol=1e-9)
        np.testing.assert_allclose(told.prior[:, g], prior, rtol=1e-9)
        assert told.cost[g] == pytest.approx(cost, rel=1e-9)
        np.testing.assert_allclose(packed[:, g], _packed(one[None])[:, 0], rtol=1e-9, atol=1e-10)


def test_shaking_is_that_of_the_inverse_inertia() -> None:
    C = np.zeros((4, 4))
    add_torque_noise(C, 0.3, TABLE_3.theta[:4], NOISE, T)
    m11, m12, m22 = mass_matrix(0.3, *TABLE_3.theta[:4])
    inverse = np.linalg.inv([[m11, m12], [m12, m22]])
    caused = inverse @ np.diag(NOISE[:2]) @ inverse.T
    for row, column, power in ((0, 0, T**3 / 3), (0, 2, T**2 / 2), (2, 0, T**2 / 2), (2, 2, T)):
        np.testing.assert_allclose(C[row : row + 2, column : column + 2], caused * power, rtol=1e-12)
