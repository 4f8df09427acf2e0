"""The Gaussian log-likelihood of innovations and its derivatives, sample by sample."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant.compiled import compiled


def innovation_cost(e: NDArray[np.float64], S: NDArray[np.float64]) -> float:
    """½ Σ (eᵀ S⁻¹ e + ln det S) of e (N, 2), S (N, 3) = (S11, S12, S22)."""
    return float(np.sum(sample_costs(e, S)))


def sample_costs(e: NDArray[np.float64], S: NDArray[np.float64]) -> NDArray[np.float64]:
    """½ (eᵀ S⁻¹ e + ln det S) of every sample (N,); inf where S is no covariance, as of a filter that lost its log."""
    with np.errstate(all="ignore"):
        det = S[:, 0] * S[:, 2] - S[:, 1] ** 2
        q = (S[:, 2] * e[:, 0] ** 2 - 2.0 * S[:, 1] * e[:, 0] * e[:, 1] + S[:, 0] * e[:, 1] ** 2) / det
        costs = 0.5 * (q + np.log(det))
    return np.where(np.isfinite(costs), costs, np.inf)


def whiten(e: NDArray[np.float64], S: NDArray[np.float64]) -> NDArray[np.float64]:
    """L⁻¹ e with S = L Lᵀ: white with unit variance if the model is right. e (N, 2) or (N, 2, m)."""
    l11 = np.sqrt(S[:, 0])
    l21 = S[:, 1] / l11
    l22 = np.sqrt(S[:, 2] - l21**2)
    shape = (-1,) + (1,) * (e.ndim - 2)
    w1 = e[:, 0] / l11.reshape(shape)
    return np.stack([w1, (e[:, 1] - l21.reshape(shape) * w1) / l22.reshape(shape)], axis=1)


@compiled(nogil=True)
def differentiate(e, S, cost, steps, columns, rows, scores):
    """Σ cost of filter 0 of a bank, and the derivatives that its other filters give: see `_score_row`.

    e (N, 2, B), S (N, 3, leaders), cost (N, leaders); filter j + 1 is shifted by steps[j] in coordinate columns[j].
    """
    N, B, G = e.shape[0], e.shape[2], S.shape[2]
    V = 0.0
    de, dS = np.empty(2), np.zeros(3)
    for k in range(N):
        V += cost[k, 0]
        l11 = math.sqrt(S[k, 0, 0])
        l21 = S[k, 1, 0] / l11
        l22 = math.sqrt(S[k, 2, 0] - l21 * l21)
        w1 = e[k, 0, 0] / l11
        w2 = (e[k, 1, 0] - l21 * w1) / l22
        for j in range(1, B):
            i = columns[j - 1]
            for a in range(2):
                de[a] = (e[k, a, j] - e[k, a, 0]) / steps[j - 1]
            for a in range(3):
                dS[a] = (S[k, a, j] - S[k, a, 0]) / steps[j - 1] if j < G else 0.0
            _score_row(w1, w2, l11, l21, l22, de, dS, rows[k], scores[k], i)
            if j < G:  # a one-sided difference, less its own curvature term ½ h V″ (the rows hold V″)
                curvature = 0.0
                for a in range(5):
                    curvature += rows[k, a, i] ** 2
                scores[k, i] = (cost[k, j] - cost[k, 0]) / steps[j - 1] - 0.5 * steps[j - 1] * curvature
    return V


@compiled(nogil=True)
def _score_row(w1, w2, l11, l21, l22, de, dS, rows, scores, i):
    """Column i of one sample's score (n,) and of the rows (5, n) whose Gram matrix is its Fisher information.

    With S = L Lᵀ, w = L⁻¹ e, d = L⁻¹ de and A = L⁻¹ dS L⁻ᵀ: score = wᵀ d + ½ tr A − ½ wᵀ A w, and the information
    d dᵀ + ½ tr A A comes from the rows d1, d2, A11/√2, A12, A22/√2.
    """
    d1 = de[0] / l11
    d2 = (de[1] - l21 * d1) / l22
    a11 = dS[0] / (l11 * l11)
    b = (dS[1] - l21 * dS[0] / l11) / l22  # (L⁻¹ dS)21
    a12 = b / l11
    a22 = ((dS[2] - l21 * dS[1] / l11) / l22 - l21 * b / l11) / l22
    rows[0, i], rows[1, i] = d1, d2
    rows[2, i], rows[3, i], rows[4, i] = a11 * math.sqrt(0.5), a12, a22 * math.sqrt(0.5)
    scores[i] = w1 * d1 + w2 * d2 + 0.5 * (a11 + a22 - w1 * w1 * a11 - 2.0 * w1 * w2 * a12 - w2 * w2 * a22)
