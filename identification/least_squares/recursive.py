"""Recursive least squares with forgetting on the paper's filtered model: the on-line form of Eq. (2).

The state is the triangular factor R of the information matrix, RᵀR = Σ μ^(k−i) Y(i)ᵀ Y(i), and z with R θ̂ = z. Each
sample multiplies both by √μ and rotates the two new rows of (21) in (Givens). Unlike the textbook update of a
covariance matrix, this cannot lose symmetry or sign, and with μ = 1 it is Eq. (2) at every k to rounding.

The regressors must be computed causally for a true on-line use; from a recorded log they are those of
`filtered_model`, zero-phase filter included, so that on-line and batch are compared on equal data.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from furuta_gym.plant.compiled import compiled

from .filtered_model import FilteredModel, ParameterHistory, joined_times

PRIOR_INFORMATION = 1e-10
"""Weight of the start value, in (unit of u)² per (unit of θ)²: it makes R invertible and nothing more."""


def recursive_least_squares(
    models: FilteredModel | Sequence[FilteredModel],
    *,
    forgetting: float = 1.0,
    theta0: np.ndarray | None = None,
    prior_information: float = PRIOR_INFORMATION,
) -> ParameterHistory:
    """θ̂ after each sample, shape (n, 9), of all models one after the other.

    forgetting: μ in (0, 1]; the memory is T/(1 − μ) seconds long (μ = 0.9995 at 1 ms: 2 s). With μ < 1 directions
    that are not excited are forgotten too, and the estimate then wanders there.
    theta0 (9,), prior_information: the start value and its weight, for example from an earlier identification.
    Raises ValueError for arguments out of range.
    """
    if not 0 < forgetting <= 1:
        raise ValueError(f"forgetting = {forgetting}: expected a factor in (0, 1], as 0.999")
    if not (np.isfinite(prior_information) and prior_information > 0):
        raise ValueError(f"prior_information = {prior_information}: expected a positive number")
    start = np.zeros(9) if theta0 is None else np.array(theta0, dtype=np.float64)
    if start.shape != (9,) or not np.isfinite(start).all():
        raise ValueError(f"theta0 has shape {start.shape}: expected 9 finite numbers")
    models = (models,) if isinstance(models, FilteredModel) else tuple(models)
    omega_f = np.concatenate([model.omega_f for model in models])
    u_f = np.concatenate([model.u_f for model in models])
    R = np.sqrt(prior_information) * np.eye(9)
    theta = np.empty((len(u_f), 9))
    _rotate_in(omega_f, u_f, np.sqrt(forgetting), R, R @ start, theta)
    return ParameterHistory(joined_times(models), theta)


@compiled
def _rotate_in(omega_f, u_f, root_mu, R, z, theta):
    """Givens rotations of all rows into (R, z), which are overwritten; θ̂ after each sample into theta."""
    n, rows, p = omega_f.shape
    x = np.empty(p)
    for k in range(n):
        R *= root_mu
        z *= root_mu
        for row in range(rows):
            x[:] = omega_f[k, row]
            y = u_f[k, row]
            for i in range(p):
                if x[i] == 0.0:
                    continue
                length = np.hypot(R[i, i], x[i])
                c, s = R[i, i] / length, x[i] / length
                for j in range(i, p):
                    old = R[i, j]
                    R[i, j] = c * old + s * x[j]
                    x[j] = c * x[j] - s * old
                old = z[i]
                z[i] = c * old + s * y
                y = c * y - s * old
        for i in range(p - 1, -1, -1):
            total = z[i]
            for j in range(i + 1, p):
                total -= R[i, j] * theta[k, j]
            theta[k, i] = total / R[i, i]
