"""The estimators by name, each a class with `estimate(logs, template, start, **options)`, loaded when it is used."""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from furuta_gym.plant import Plant

    from ..logs.log import Log
    from .estimate import Estimate


class Estimator(Protocol):
    """Turns logs of one rig into an Estimate."""

    def estimate(self, logs: Sequence[Log], template: Plant, start: Plant | None, /, **options: Any) -> Estimate:
        """logs: at least one, of one command unit, that excite θ. template: a plant that supplies the unit, u_max and
        sample time of the result, and θ where the user gave a start; start: that plant, or None.

        The keyword-only arguments of a class are the options of `identify` that it uses; `identify` refuses the
        others, and adds covariance, sensors, provenance and checks to the plant of the result. Raises ValueError where
        the logs give no plant.
        """
        ...


@dataclass(frozen=True)
class Method:
    """Where an estimator's class is (a module of this package as `.ekf`, or a full path), and one line on it."""

    module: str
    cls: str
    summary: str

    def load(self) -> Estimator:
        return getattr(import_module(self.module, __package__), self.cls)()

    def options(self) -> tuple[str, ...]:
        """The options of `identify` that it uses."""
        parameters = inspect.signature(self.load().estimate).parameters.values()
        return tuple(p.name for p in parameters if p.kind is p.KEYWORD_ONLY)


DEFAULT = "prediction-error"

METHODS: dict[str, Method] = {
    DEFAULT: Method(".most_likely", "PredictionErrorMethod", "maximum likelihood by a Kalman filter's innovations"),
    "filtered-ls": Method(".classical", "FilteredLeastSquares", "the paper's"),
    "recursive-ls": Method(".classical", "RecursiveLeastSquares", "the paper's, on line"),
    "ekf": Method(".classical", "ExtendedKalmanFilter", "joints and θ in one filter, on line"),
}


def method_named(name: str) -> Method:
    """The method with that name. Raises ValueError, with the names there are."""
    if name not in METHODS:
        raise ValueError(f"method must be one of {', '.join(METHODS)}, got {name!r}")
    return METHODS[name]
