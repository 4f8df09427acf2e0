"""The nine parameters of model (5): names, meanings, units, and what makes them a possible rigid body."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

THETA_NAMES = tuple(f"theta{i}" for i in range(1, 10))

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


@dataclass(frozen=True)
class ConsistencyCheck:
    """Whether a rigid arm with a rigid pendulum can have these θ (Table 2), with a sentence on each failure."""

    consistent: bool
    failures: tuple[str, ...]

    def to_dict(self) -> dict[str, object]:
        return {"physically_consistent": self.consistent, "failures": list(self.failures)}


def physical_consistency(theta: ArrayLike) -> ConsistencyCheck:
    """Check θ (9,) against Table 2: J1 = θ1 − θ3²/θ2 ≥ 0, J2 = θ4 − θ2 ≥ 0, θ2, θ5 > 0 and friction ≥ 0."""
    th = np.asarray(theta, dtype=float)
    failures = []
    if th[1] <= 0:
        failures.append(f"θ2 = m2 l2² must be positive, is {th[1]:.4g}")
    else:
        with np.errstate(over="ignore"):  # a θ2 near 0 makes J1 −∞
            J1 = th[0] - th[2] ** 2 / th[1]
        if J1 < 0:
            failures.append(f"θ1 ≥ θ3²/θ2 is violated: J1 = {J1:.4g} < 0")
    if th[3] < th[1]:
        failures.append(f"θ4 ≥ θ2 is violated: J2 = θ4 − θ2 = {th[3] - th[1]:.4g} < 0")
    if th[4] <= 0:
        failures.append(f"θ5 = m2 l2 g must be positive, is {th[4]:.4g}")
    failures += [f"friction θ{i + 1} must not be negative, is {th[i]:.4g}" for i in range(5, 9) if th[i] < 0]
    return ConsistencyCheck(not failures, tuple(failures))


@dataclass(frozen=True)
class RigidBody:
    """A physical rotary pendulum, from which θ follows by Table 2.

    J1 [kg·m²] is the arm's inertia about its axis with everything that turns with it but the pendulum, L1 [m] the
    arm's length, m2 [kg] the pendulum's mass, l2 [m] the distance of its centre of mass, J2 [kg·m²] its inertia
    about that centre. `gain` [{u}/(N·m)] turns torques into the command's unit (1 for a torque command).
    """

    J1: float
    L1: float
    m2: float
    l2: float
    J2: float
    Fv1: float
    Fv2: float
    Fc1: float
    Fc2: float
    gain: float = 1.0
    gravity: float = 9.81

    def theta(self) -> NDArray[np.float64]:
        """θ (9,) of Table 2, times `gain`."""
        m2, L1, l2 = self.m2, self.L1, self.l2
        inertial = [m2 * L1**2 + self.J1, m2 * l2**2, m2 * L1 * l2, m2 * l2**2 + self.J2, m2 * l2 * self.gravity]
        return theta_vector(self.gain * np.array([*inertial, self.Fv1, self.Fv2, self.Fc1, self.Fc2]))
