"""The nine parameters of model (5): names, meanings and units."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

THETA_NAMES = tuple(f"theta{i}" for i in range(1, 10))

FRICTION_SHARPNESS = 100.0
"""Usual r [s/rad] of tanh(r q̇), which the paper does not give: full friction beyond 0.02 rad/s."""

# Table 2 of the paper. {u} is the unit of the command: with a voltage as command, θ is in volts per …
THETA_MEANING = {
    "theta1": ("m2 L1² + J1", "{u}·s²/rad"),
    "theta2": ("m2 l2²", "{u}·s²/rad"),
    "theta3": ("m2 L1 l2", "{u}·s²/rad"),
    "theta4": ("m2 l2² + J2", "{u}·s²/rad"),
    "theta5": ("m2 l2 g", "{u}/rad"),
    "theta6": ("arm viscous friction Fv1", "{u}·s/rad"),
    "theta7": ("pendulum viscous friction Fv2", "{u}·s/rad"),
    "theta8": ("arm Coulomb friction Fc1", "{u}"),
    "theta9": ("pendulum Coulomb friction Fc2", "{u}"),
}

LARGEST = 1e12  # of a θ in whatever units; beyond it products of two overflow or vanish


def plain_numbers(value: Any) -> NDArray[np.float64]:
    """Numbers of any shape as an array; unlike NumPy's own, texts and truth values are none.

    Raises TypeError, ValueError or OverflowError."""
    level = [value]
    while level:
        if any(isinstance(v, str | bool) for v in level):
            raise TypeError("texts and truth values are no numbers")
        level = [inner for v in level if isinstance(v, list | tuple) for inner in v]
    return np.array(value, dtype=float)


def theta_vector(theta: ArrayLike | dict[str, float]) -> NDArray[np.float64]:
    """θ as a read-only array (9,), from nine numbers or from a mapping theta1 … theta9.

    Raises ValueError on a missing or unknown name, a wrong count, NaN, or a mass matrix that is not positive definite
    for every q2 (θ1 > 0, θ4 > 0, θ1 θ4 > θ3², (θ1 + θ2) > 0).
    """
    if isinstance(theta, dict):
        missing, strange = set(THETA_NAMES) - set(theta), set(theta) - set(THETA_NAMES)
        if missing or strange:
            raise ValueError(
                f"theta needs exactly {', '.join(THETA_NAMES)}; missing {sorted(missing)}, unknown {sorted(strange)}"
            )
        theta = [theta[name] for name in THETA_NAMES]
    try:
        values = plain_numbers(theta)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"theta must be nine numbers, got {theta!r}") from None
    if values.shape != (9,) or not np.isfinite(values).all():
        raise ValueError(f"theta must be nine finite numbers, got {theta!r}")
    if np.abs(values).max() > LARGEST or not (values[[0, 3]] > 1.0 / LARGEST).all():
        raise ValueError(f"theta must lie within ±{LARGEST:g}, and θ1, θ4 above {1.0 / LARGEST:g}, got {theta!r}")
    th1, th2, th3, th4 = values[:4]
    # det M = (θ1 + θ2 sin²)θ4 − θ3² cos² is linear in sin² q2: its two ends decide
    if not (th1 > 0 and th4 > 0 and th1 + th2 > 0 and th1 * th4 > th3 * th3):
        raise ValueError(
            "the mass matrix is not positive definite for every q2: need θ1 > 0, θ4 > 0, θ1 + θ2 > 0 and θ1 θ4 > θ3², "
            f"got θ1 … θ4 = {', '.join(f'{v:.6g}' for v in values[:4])}"
        )
    values.setflags(write=False)
    return values


def pendulum_frequency(theta: ArrayLike) -> float:
    """√|θ5/θ4| [rad/s]: of small swings of the hanging pendulum with the arm held, and the rate at which it falls.

    theta: at least θ1 … θ5.
    """
    th = np.asarray(theta, dtype=float)
    return float(np.sqrt(abs(th[4] / th[3])))
