"""Model (5) as linear in θ: Y(q, q̇, q̈) θ = (τ, 0), and the parts Ω_a, Ω_b of Eq. (14) with all nine columns."""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def _columns(q: ArrayLike, v: ArrayLike) -> tuple[NDArray[np.float64], ...]:
    q, v = np.atleast_2d(np.asarray(q, dtype=float)), np.atleast_2d(np.asarray(v, dtype=float))
    if q.shape != v.shape or q.shape[1] != 2:
        raise ValueError(f"q and v must both have shape (n, 2), got {q.shape} and {v.shape}")
    return q[:, 1], v[:, 0], v[:, 1]


def omega_a(q: ArrayLike, v: ArrayLike) -> NDArray[np.float64]:
    """Ω_a (n, 2, 9) of Eq. (14): the momenta M(q) q̇ as linear in θ. q, v: (n, 2) in rad and rad/s."""
    q2, v1, v2 = _columns(q, v)
    omega = np.zeros((q2.size, 2, 9))
    omega[:, 0, 0] = v1
    omega[:, 0, 1] = v1 * np.sin(q2) ** 2
    omega[:, 0, 2] = v2 * np.cos(q2)
    omega[:, 1, 2] = v1 * np.cos(q2)
    omega[:, 1, 3] = v2
    return omega


def omega_b(q: ArrayLike, v: ArrayLike, r: float | tuple[float, float]) -> NDArray[np.float64]:
    """Ω_b (n, 2, 9) of Eq. (14): what d/dt of the momenta leaves over. r [s/rad], one or one for each axis."""
    q2, v1, v2 = _columns(q, v)
    r1, r2 = np.broadcast_to(np.asarray(r, dtype=float), (2,))
    omega = np.zeros((q2.size, 2, 9))
    omega[:, 0, 5] = v1
    omega[:, 0, 7] = np.tanh(r1 * v1)
    omega[:, 1, 1] = -0.5 * np.sin(2.0 * q2) * v1**2
    omega[:, 1, 2] = v1 * v2 * np.sin(q2)
    omega[:, 1, 4] = -np.sin(q2)
    omega[:, 1, 6] = v2
    omega[:, 1, 8] = np.tanh(r2 * v2)
    return omega


def regressor(q: ArrayLike, v: ArrayLike, a: ArrayLike, r: float | tuple[float, float]) -> NDArray[np.float64]:
    """Y (n, 2, 9) with Y θ = (τ, 0): d/dt Ω_a + Ω_b of Eq. (14), the derivative taken by the chain rule.

    q [rad], v [rad/s] and a = q̈ [rad/s²] are (n, 2); r [s/rad] as in `omega_b`. Raises ValueError on other shapes.
    """
    q2, v1, v2 = _columns(q, v)
    a = np.atleast_2d(np.asarray(a, dtype=float))
    if a.shape != (q2.size, 2):
        raise ValueError(f"a must have shape {(q2.size, 2)} like q and v, got {a.shape}")
    r1, r2 = np.broadcast_to(np.asarray(r, dtype=float), (2,))
    (a1, a2), s, c = a.T, np.sin(q2), np.cos(q2)
    Y = np.zeros((q2.size, 2, 9))
    Y[:, 0, 0] = a1
    Y[:, 0, 1] = s * s * a1 + 2 * s * c * v1 * v2
    Y[:, 0, 2] = c * a2 - s * v2**2
    Y[:, 0, 5] = v1
    Y[:, 0, 7] = np.tanh(r1 * v1)
    Y[:, 1, 1] = -s * c * v1**2
    Y[:, 1, 2] = c * a1
    Y[:, 1, 3] = a2
    Y[:, 1, 4] = -s
    Y[:, 1, 6] = v2
    Y[:, 1, 8] = np.tanh(r2 * v2)
    return Y
