"""A torque on the arm that no effect names, as the most likely smooth surface over its angle and speed.

Along smoothed motions the innovations answer linearly to the surface's coefficients: a regression with a penalty on
their second differences (Eilers & Marx 1996, "Flexible smoothing with B-splines and penalties") whose weight has the
largest evidence (MacKay 1992). What other values of θ would explain as well is left to θ.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import Effect, Plant
from furuta_gym.plant.effects.learned import ANGLES, COEFFICIENTS, SPEEDS, surface_columns

from ..kalman.likelihood import whiten
from ..kalman.noise import fit_noise
from ..kalman.path import FilterPath, along, smooth
from ..kalman.record import Record
from .basis import Columns, Signals, parameter_torques
from .response import PRECISIONS, answers, most_likely_precision

Array = NDArray[np.float64]

NAME = "arm_learned"
_EDGE = 0.005  # quantile of the angles at which the surface ends
_NARROWEST = 0.1  # rad
_FLAT = 0.05  # of the penalty on bends: that on the coefficients themselves, which unseen corners need


@dataclass(frozen=True)
class Surface:
    """The effect `arm_learned` that makes logs most likely, and its evidence [nats] over a plant without."""

    effect: Effect
    evidence: float


def most_likely_surface(plant: Plant, records: Sequence[Record], refitted: bool = True) -> Surface:
    """The surface for a plant, which may carry an earlier one; that one's edges stay.

    refitted: whether θ will be estimated again with the surface in place; if not, the surface takes all.
    Raises ValueError if the filter loses a record.
    """
    paths = [_smoothed(plant, record) for record in records]
    signals = [Signals.of(path) for path in paths]
    before = plant.effect(NAME)
    edges = _edges(signals) if before is None else {k: before.parameters[k] for k in ("low", "width", "w")}
    c = np.array([before.parameters[name] if before else 0.0 for name in COEFFICIENTS])
    m, theta = len(c), 9 if refitted else 0
    gram, right = np.zeros((m + theta, m + theta)), np.zeros(m + theta)
    for path, s in zip(paths, signals, strict=True):
        columns = surface_columns(s.q[:, 0], s.v[:, 0], edges["low"], edges["width"], edges["w"])
        D = answers(path, Columns(torque=np.stack([columns, np.zeros_like(columns)], axis=1)))
        if theta:
            D = np.concatenate([D, answers(path, Columns(torque=parameter_torques(s, plant)))], axis=1)
        gram += D.T @ D
        right += -D.T @ whiten(path.e, path.S).ravel() + D.T @ (D[:, :m] @ c)
    G, r = _without(gram, right, m)
    root = np.linalg.inv(np.linalg.cholesky(_bends())).T  # coefficients = root × what a plain ridge weighs alike
    values, vectors = np.linalg.eigh(root.T @ G @ root)
    values, told = np.maximum(values, 0.0), vectors.T @ root.T @ r
    precision, evidence = most_likely_precision(values, told, PRECISIONS * max(float(values.mean()), 1e-300))
    found = root @ vectors @ (told / (values + precision))
    return Surface(Effect(NAME, {**edges, **dict(zip(COEFFICIENTS, found.tolist(), strict=True))}), evidence)


def _smoothed(plant: Plant, record: Record) -> FilterPath:
    """The log linearised along its smoothed motion."""
    path = fit_noise(plant, record).path
    smoothed = smooth(path)
    return along(path, smoothed.mean, smoothed.variance[:, 2:4]) or path


def _bends() -> Array:
    """The penalty: Σ of squared second differences of the coefficients along the angle and along the speed, and a
    little of their squares."""
    along_angle, along_speed = (np.diff(np.eye(m), 2, axis=0) for m in (ANGLES, SPEEDS))
    angle = np.kron(along_angle.T @ along_angle, np.eye(SPEEDS))
    speed = np.kron(np.eye(ANGLES), along_speed.T @ along_speed)
    return angle + speed + _FLAT * np.eye(ANGLES * SPEEDS)


def _edges(signals: Sequence[Signals]) -> dict[str, float]:
    q1, v1 = (np.concatenate([getattr(s, name)[:, 0] for s in signals]) for name in ("q", "v"))
    low, high = np.quantile(q1, [_EDGE, 1.0 - _EDGE])
    return {
        "low": float(low),
        "width": max(float(high - low), _NARROWEST),
        "w": max(float(np.median(np.abs(v1))), 1e-3),
    }


def _without(gram: Array, right: Array, m: int) -> tuple[Array, Array]:
    """The normal equations of the first m coefficients, the others left free."""
    if len(right) == m:
        return gram, right
    scale = 1.0 / np.sqrt(np.maximum(np.diag(gram)[m:], 1e-300))
    inner = gram[m:, m:] * np.outer(scale, scale) + 1e-9 * np.eye(len(scale))
    across = gram[:m, m:] * scale
    G = gram[:m, :m] - across @ np.linalg.solve(inner, across.T)
    return 0.5 * (G + G.T), right[:m] - across @ np.linalg.solve(inner, right[m:] * scale)
