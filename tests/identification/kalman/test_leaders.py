"""Covariances of filters side by side, against matrix algebra, for states that are written out and for larger ones."""

from __future__ import annotations

import numpy as np
import pytest

from furuta_gym.plant import TABLE_3
from identification.kalman.arguments import LeaderReadings
from identification.kalman.bank import add_torque_noise, read_pair
from identification.kalman.leaders import add_noise_to_leaders, propagate_leaders, read_leaders

L = 4
QUANTUM = np.array([0.05, 0.0])
NOISE = np.array([0.3, 0.4, 0.02, 0.03])  # intensities of torques, variances of readings


def _covariances(n: int) -> np.ndarray:
    rng = np.random.default_rng(n)
    root = rng.normal(size=(L, n, n))
    return root @ root.transpose(0, 2, 1)


def _packed(C: np.ndarray) -> np.ndarray:
    rows, columns = np.tril_indices(C.shape[1])
    return np.ascontiguousarray(C[:, rows, columns].T)


@pytest.mark.parametrize("n", [4, 5, 6, 8])
@pytest.mark.parametrize("own", [False, True])
def test_a_step_is_that_of_the_matrices(n: int, own: bool) -> None:
    C = _covariances(n)
    Phi = np.random.default_rng(1).normal(size=(n, n, L if own else 1))
    packed = _packed(C)
    propagate_leaders(packed, Phi, np.empty((n, n, L)))
    by_hand = np.array([Phi[:, :, g % Phi.shape[2]] @ C[g] @ Phi[:, :, g % Phi.shape[2]].T for g in range(L)])
    np.testing.assert_allclose(packed, _packed(by_hand), rtol=1e-12, atol=1e-12)
    q2, noise = np.linspace(-1.0, 2.0, L), np.repeat(NOISE[:, None], L, axis=1)
    add_noise_to_leaders(packed, q2, np.repeat(TABLE_3.theta[:4, None], L, axis=1), noise, 0.01)
    for g in range(L):
        add_torque_noise(by_hand[g], q2[g], TABLE_3.theta[:4], NOISE, 0.01)
    np.testing.assert_allclose(packed, _packed(by_hand), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("n", [4, 5, 6, 8])
@pytest.mark.parametrize("direct", [True, False])
def test_a_pair_of_readings_is_that_of_one_filter(n: int, direct: bool) -> None:
    C = _covariances(n)
    H = np.zeros((2, n))
    H[0, 0] = H[1, 1] = 1.0
    if not direct:
        H += 0.1 * np.random.default_rng(2).normal(size=H.shape)
    d = np.random.default_rng(3).normal(size=(2, L))
    packed, told = _packed(C), LeaderReadings.empty(n, L)
    noise = np.repeat(NOISE[2:, None], L, axis=1)
    read_leaders(packed, np.repeat(H[:, :, None], L, axis=2), direct, noise, d, QUANTUM, told)
    for g in range(L):
        K, e, S, prior = np.empty((n, 2)), np.empty(2), np.empty(3), np.empty(2)
        cost = read_pair(C[g], H, NOISE, d[:, g].copy(), QUANTUM, K, e, S, prior, np.empty(n))
        np.testing.assert_allclose(told.K[:, :, g], K.T, rtol=1e-10, atol=1e-12)
        np.testing.assert_allclose(told.e[:, g], e, rtol=1e-10)
        np.testing.assert_allclose(told.S[:, g], S, rtol=1e-10)
        np.testing.assert_allclose(told.prior[:, g], prior, rtol=1e-10)
        assert told.cost[g] == pytest.approx(cost, rel=1e-10)
    np.testing.assert_allclose(packed, _packed(C), rtol=1e-10, atol=1e-12)
