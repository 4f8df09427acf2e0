"""Least squares on the filtered model, Eq. (2): θ̂ = (Σ Ω_fᵀ Ω_f)⁻¹ Σ Ω_fᵀ u_f, in one go and over time.

The second row of (21) has no input, so every error in Ω_f is an error in the variables and pulls θ2 … θ5, θ7, θ9
towards zero, by tens of percent with real encoders. The result says so where it shows;
`identification.estimation.prediction_error` has the estimator without that bias.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from furuta_gym.plant.parameters import FRICTION_SHARPNESS

from ..logs.log import Log, as_logs
from .filtered_model import (
    LAMBDA,
    FilteredModel,
    ParameterHistory,
    filtered_models,
    joined_times,
    stacked,
)
from .signals import WC

_RANK_TOLERANCE = 1e-7  # of the largest singular value: below, a direction counts as not determined
_VELOCITY_LOST = 0.05
_BLOCKS = 10  # of time, for the jackknife


@dataclass(frozen=True)
class LeastSquaresEstimate:
    """θ̂ of Eq. (2), with what is needed to judge it. Printing it gives the verdict in words.

    theta (9,), NaN where the data do not determine a parameter. covariance (9, 9): the classical σ² (YᵀY)⁻¹, which
    is right only if Y is free of noise and the residuals are white; here neither holds, so it is far too
    small, and it knows nothing of the bias. residual_rms (2,): of both rows of (21), in the command's unit.
    condition: of Y with columns of unit length. weakest (9,): unit vector in those columns' coordinates.
    warnings: what to look at, each with what to do next.
    """

    theta: np.ndarray
    covariance: np.ndarray
    residual_rms: np.ndarray
    condition: float
    weakest: np.ndarray
    samples: int
    input_unit: str
    lam: float
    r: float
    wc: float
    warnings: tuple[str, ...] = ()

    @property
    def std(self) -> np.ndarray:
        """Classical standard deviations, shape (9,); see `covariance` for why not to trust them."""
        return np.sqrt(np.diag(self.covariance))

    def __str__(self) -> str:
        lines = [
            f"Filtered least squares, Eq. (2), in {self.input_unit}: λ = {self.lam:g} 1/s, r = {self.r:g} s/rad, "
            f"wc = {self.wc:g}, {self.samples} samples",
            "       estimate      ± classical (too small, ignores bias)",
        ]
        for i, (value, std) in enumerate(zip(self.theta, self.std, strict=True), 1):
            lines.append(f"  θ{i}   {value:+.5g}".ljust(22) + (f"{std:.1e}" if np.isfinite(value) else "not excited"))
        rms = self.residual_rms
        lines.append(f"  residual rms {rms[0]:.3g} (arm), {rms[1]:.3g} (pendulum) {self.input_unit}")
        lines.append(f"  condition {self.condition:.3g}; weakest direction: {direction_words(self.weakest)}")
        lines += [f"  ! {warning}" for warning in self.warnings]
        return "\n".join(lines)


def solve(models: Sequence[FilteredModel], input_unit: str = "V") -> LeastSquaresEstimate:
    """Batch least squares (2) over all samples of all models, by SVD of the scaled regressor.

    A direction of θ that the data do not determine is not guessed: the parameters in it are NaN.
    """
    Y, u = stacked(models)
    scale = np.linalg.norm(Y, axis=0)
    safe = np.where(scale > 0, scale, 1.0)
    left, s, right = np.linalg.svd(Y / safe, full_matrices=False)
    kept = s > _RANK_TOLERANCE * s[0]
    theta = (right[kept].T @ ((left[:, kept].T @ u) / s[kept])) / safe
    undetermined: np.ndarray = np.any(np.abs(right[~kept]) > 0.1, axis=0)
    if all(model.held[0] for model in models):  # by a torque that is not in u; the other row gives ratios only
        undetermined[:] = True
    if all(model.held[1] for model in models):
        undetermined[[1, 2, 3, 4, 6, 8]] = True
    residual = (u - Y @ theta).reshape(-1, 2)
    variance = float(np.sum(residual**2)) / max(residual.size - 9, 1)
    inverse = (right[kept].T / s[kept] ** 2) @ right[kept]
    covariance = variance * inverse / np.outer(safe, safe)
    notes = []
    if undetermined.any():
        theta = np.where(undetermined, np.nan, theta)
        notes.append(
            f"{_names(undetermined)} cannot be determined from this motion (rank {kept.sum()} of 9). "
            "Was an axis held, or its encoder not connected? Move both, the pendulum also far from upright."
        )
    weak: np.ndarray = ~undetermined & (np.sqrt(np.diag(covariance)) > 0.3 * np.abs(theta))
    if weak.any():
        notes.append(
            f"{_names(weak)} hardly excited (classical error above 30 %): excite more, or give what you know to the "
            "method prediction-error."
        )
    negative: np.ndarray = ~undetermined & (theta < 0)
    if negative.any():
        notes.append(f"{_names(negative)} negative, which no rig is: bias, a wrong sign (flip) or a missing effect.")
    lost = max(model.velocity_lost for model in models)
    if lost > _VELOCITY_LOST:
        notes.append(
            f"the position filter takes away about {100 * lost:.0f} % of the velocity at T = {models[0].T:g} s. "
            f"Use the method prediction-error, or raise wc from {models[0].wc:g}, which suits T = 1 ms "
            "(`filtered_least_squares(logs, wc=…)` in Python)."
        )
    return LeastSquaresEstimate(
        theta=theta,
        covariance=covariance,
        residual_rms=np.sqrt(np.mean(residual**2, axis=0)),
        condition=float(s[0] / s[-1]) if s[-1] > 0 else np.inf,
        weakest=right[-1],
        samples=len(residual),
        input_unit=input_unit,
        lam=models[0].lam,
        r=models[0].r,
        wc=models[0].wc,
        warnings=tuple(notes),
    )


def filtered_least_squares(
    logs: Log | Sequence[Log],
    *,
    lam: float = LAMBDA,
    r: float = FRICTION_SHARPNESS,
    wc: float = WC,
    T: float | None = None,
) -> LeastSquaresEstimate:
    """The paper's estimate from one log or several, with a check for its bias.

    The check: were (21) free of errors in the variables, θ̂ would not depend on λ. It is estimated at λ and at 3λ;
    a change beyond 10 % and beyond four of its own standard deviations (jackknife over blocks of time) is
    reported. (A specification test in the sense of Hausman: two estimators that agree if the model holds.)
    """
    logs = as_logs(logs)
    models = filtered_models(logs, lam=lam, r=r, wc=wc, T=T)
    estimate = solve(models, logs[0].input_unit)
    changed = _bandwidth_change(models, filtered_models(logs, lam=3 * lam, r=r, wc=wc, T=T), estimate.theta)
    if not changed:
        return estimate
    words = ", ".join(f"θ{i + 1} by {100 * change:+.0f} %" for i, change in changed.items())
    note = (
        f"biased: raising λ from {lam:g} to {3 * lam:g} changes {words}, and a sound estimate would not care. Noise in "
        "the regressors (it pulls towards zero), or an effect that the model lacks: use the prediction-error method."
    )
    return replace(estimate, warnings=(*estimate.warnings, note))


def evolution(models: Sequence[FilteredModel], points: int = 400) -> ParameterHistory:
    """θ̂(k) of Eq. (2) at `points` even times, each from all samples up to then (cumulative sums)."""
    Y, u = stacked(models)
    n = len(u) // 2
    scale = np.linalg.norm(Y, axis=0)
    Y = Y / np.where(scale > 0, scale, 1.0)
    ends = np.unique(np.linspace(0, n, min(points, n) + 1).astype(int)[1:])
    starts = np.concatenate([[0], ends[:-1]])
    normal, right = np.zeros((9, 9)), np.zeros(9)
    theta = np.full((len(ends), 9), np.nan)
    for m, (start, end) in enumerate(zip(starts, ends, strict=True)):
        block = Y[2 * start : 2 * end]
        normal += block.T @ block
        right += block.T @ u[2 * start : 2 * end]
        if np.linalg.cond(normal) < 1 / _RANK_TOLERANCE**2:
            theta[m] = np.linalg.solve(normal, right) / scale
    return ParameterHistory(joined_times(models)[ends - 1], theta)


def direction_words(direction: np.ndarray) -> str:
    """The parameters that make up a direction, the largest first, as "θ3 0.71, θ4 −0.69"."""
    order = np.argsort(-np.abs(direction))
    shown = [i for i in order if abs(direction[i]) > 0.25]
    return ", ".join(f"θ{i + 1} {direction[i]:+.2f}" for i in shown)


def _names(which: np.ndarray) -> str:
    return ", ".join(f"θ{i + 1}" for i in np.flatnonzero(which))


def _bandwidth_change(
    models: Sequence[FilteredModel], wider: Sequence[FilteredModel], theta: np.ndarray
) -> dict[int, float]:
    """Relative changes of θ̂ from `models` to `wider` that are large and significant, by index."""
    if not np.isfinite(theta).all():
        return {}
    changes = []
    systems = [_block_normals(models), _block_normals(wider)]
    for left_out in range(-1, _BLOCKS):
        pair = []
        for normals, rights in systems:
            keep = np.arange(_BLOCKS) != left_out
            pair.append(np.linalg.lstsq(normals[keep].sum(0), rights[keep].sum(0), rcond=1e-14)[0])
        changes.append(pair[1] - pair[0])
    full, left_outs = changes[0], np.array(changes[1:])
    std = np.sqrt((_BLOCKS - 1) * np.var(left_outs, axis=0))
    relative = full / np.abs(theta)
    found = np.flatnonzero((np.abs(relative) > 0.1) & (np.abs(full) > 4 * std))
    return {int(i): float(relative[i]) for i in found}


def _block_normals(models: Sequence[FilteredModel]) -> tuple[np.ndarray, np.ndarray]:
    """YᵀY (blocks, 9, 9) and Yᵀu (blocks, 9) over consecutive blocks of time."""
    Y, u = stacked(models)
    n = len(u) // 2
    edges = 2 * np.linspace(0, n, _BLOCKS + 1).astype(int)
    parts = [(Y[a:b], u[a:b]) for a, b in pairwise(edges)]
    return np.array([y.T @ y for y, _ in parts]), np.array([y.T @ v for y, v in parts])
