"""The paper's least squares and the on-line identifiers behind the same door: logs in, Estimate out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import THETA_NAMES, Plant
from furuta_gym.plant.parameters import FRICTION_SHARPNESS

from ..least_squares.batch import filtered_least_squares
from ..least_squares.filtered_model import filtered_models
from ..least_squares.recursive import recursive_least_squares
from ..logs.log import Log
from .estimate import Estimate
from .identifiability import Motion, judge, spoken
from .uncertainty import inverse_information

_BIASED = "its standard deviations are classical: they ignore the bias and are far too small"
_LINEARISED = (
    "its standard deviations are those of the filter itself: they allow for nothing that the model lacks, and may be "
    "far too small even where it lacks nothing"
)


class FilteredLeastSquares:
    """The paper's batch least squares on the filtered dynamic model."""

    def estimate(self, logs: Sequence[Log], template: Plant, start: Plant | None, /) -> Estimate:
        return _estimate(logs, "filtered-ls", template, start)


class RecursiveLeastSquares:
    """The same, one reading at a time; its covariance is that of the batch, which the recursion ends with."""

    def estimate(self, logs: Sequence[Log], template: Plant, start: Plant | None, /) -> Estimate:
        return _estimate(logs, "recursive-ls", template, start)


class ExtendedKalmanFilter:
    """One filter over joints and θ (`ekf.track`)."""

    def estimate(self, logs: Sequence[Log], template: Plant, start: Plant | None, /) -> Estimate:
        return _estimate(logs, "ekf", template, start)


def _estimate(logs: Sequence[Log], method: str, template: Plant, start: Plant | None) -> Estimate:
    """Raises ValueError where the result is no plant (these methods are biased, and may end at a negative inertia)."""
    warnings: tuple[str, ...] = ()
    sharpness = FRICTION_SHARPNESS
    if template.effects:
        lost = ", ".join(effect.name for effect in template.effects)
        warnings = (f"{method} fits model (5) alone: the start plant's {lost} is left out of the result",)
    if method == "ekf":
        from .ekf import track

        history = track(logs, start)
        theta, covariance, samples = history.theta[-1], history.covariance, len(history.t)
        sharpness, bars = history.sharpness, _LINEARISED
    else:
        batch = filtered_least_squares(logs)
        theta, covariance, samples = batch.theta, batch.covariance, batch.samples
        warnings += batch.warnings
        if method == "recursive-ls":
            theta = recursive_least_squares(filtered_models(logs)).last
        bars = _BIASED
    warnings = (*warnings, f"{method}: {bars}; compare with --method prediction-error")
    plant = _plant(theta, method, template, sharpness)
    verdict = judge(THETA_NAMES, theta, inverse_information(covariance), Motion.of(logs), np.sqrt(np.diag(covariance)))
    return Estimate(
        plant=plant,
        method=method,
        names=THETA_NAMES,
        values=theta,
        covariance=covariance,
        identifiability=verdict,
        classical=covariance,
        samples=samples,
        message="done",
        fixed={"r1": sharpness[0], "r2": sharpness[1]} if isinstance(sharpness, tuple) else {"r": sharpness},
        warnings=warnings,
        error_bars=bars,
    )


def _plant(
    theta: NDArray[np.float64],
    method: str,
    template: Plant,
    sharpness: float | tuple[float, float] = FRICTION_SHARPNESS,
) -> Plant:
    lost = [n for n, v in zip(THETA_NAMES, theta, strict=True) if not np.isfinite(v)]
    if lost:
        raise ValueError(f"{method}: {spoken(lost)} cannot be told from this motion (was an axis held?)")
    try:
        return template.replace(theta=theta, friction_sharpness=sharpness, effects=())
    except ValueError as error:
        numbers = ", ".join(f"θ{i + 1} = {v:.3g}" for i, v in enumerate(theta))
        raise ValueError(
            f"{method} ends at values that no plant can have ({numbers}): {error}. This is the bias of least squares "
            "with real encoders; use --method prediction-error"
        ) from None
