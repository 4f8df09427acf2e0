"""What makes θ that of a possible rigid body, and θ of a body with known masses and lengths."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .covariance import NORMAL_95, Covariance
from .parameters import THETA_NAMES, theta_vector

_STEPS = 20  # of Newton's method, and between the two limits


@dataclass(frozen=True)
class ConsistencyCheck:
    """Whether a rigid arm with a rigid pendulum can have these θ (Table 2), with a sentence on each failure."""

    consistent: bool
    failures: tuple[str, ...]

    def to_dict(self) -> dict[str, object]:
        return {"physically_consistent": self.consistent, "failures": list(self.failures)}


def _inertial_limits(th: NDArray[np.float64]) -> Iterator[tuple[float, NDArray[np.float64], str]]:
    """What must not be negative, its slopes over θ (9,), and the limit in words, of the two limits on inertias.

    Both are polynomials of θ, so that their error bars are those of nearly linear functions."""
    slopes = np.zeros((2, 9))
    slopes[0, [0, 1, 2]] = th[1], th[0], -2.0 * th[2]
    slopes[1, [3, 1]] = 1.0, -1.0
    with np.errstate(over="ignore"):  # a θ2 near 0 makes J1 −∞
        J1 = th[0] - th[2] * (th[2] / th[1]) if th[1] else -math.inf
    yield th[0] * th[1] - th[2] ** 2, slopes[0], f"θ1 ≥ θ3²/θ2 is violated: J1 = {J1:.4g} < 0"
    yield th[3] - th[1], slopes[1], f"θ4 ≥ θ2 is violated: J2 = θ4 − θ2 = {th[3] - th[1]:.4g} < 0"


def physical_consistency(theta: ArrayLike, covariance: Covariance | None = None) -> ConsistencyCheck:
    """Check θ (9,) against a slender rigid pendulum: θ1 ≥ θ3²/θ2, θ4 ≥ θ2 (J1, J2 ≥ 0), θ2, θ5 > 0, friction ≥ 0.

    With the covariance of an estimate, the first two fail only where they are broken by more than their error bars:
    θ4 = θ2 for a thin rod, and an estimate of that lies below it as often as above. A parameter that the covariance
    does not have counts as known.
    """
    th = np.asarray(theta, dtype=float)
    failures = []
    if th[1] <= 0:
        failures.append(f"θ2 = m2 l2² must be positive, is {th[1]:.4g}")
    for value, slopes, failure in _inertial_limits(th):
        bar = NORMAL_95 * covariance.std_along(dict(zip(THETA_NAMES, slopes, strict=True))) if covariance else 0.0
        if value < 0.0 and not value > -bar and (th[1] > 0 or slopes[3]):
            failures.append(failure + (", by more than its error bar" if bar > 0.0 else ""))
    if th[4] <= 0:
        failures.append(f"θ5 = m2 l2 g must be positive, is {th[4]:.4g}")
    failures += [f"friction θ{i + 1} must not be negative, is {th[i]:.4g}" for i in range(5, 9) if th[i] < 0]
    return ConsistencyCheck(not failures, tuple(failures))


def nearest_rigid_body(theta: ArrayLike, covariance: Covariance | None) -> NDArray[np.float64]:
    """The likeliest θ (9,) within the two limits on inertias, for an estimate that breaks them within its error bars;
    θ itself where it breaks none."""
    th = np.array(theta, dtype=float)
    if covariance is None:
        return th
    known = covariance.names
    S = np.zeros((9, 9))
    own = [(i, known.index(name)) for i, name in enumerate(THETA_NAMES) if name in known]
    for i, k in own:
        for j, m in own:
            S[i, j] = covariance.matrix[k, m]
    for _ in range(_STEPS):
        broken = [(value, slopes) for value, slopes, _ in _inertial_limits(th) if value < 0.0]
        if not broken:
            break
        for value, slopes in broken:
            towards = S @ slopes
            if (spread := slopes @ towards) > 0.0:
                th -= (1.0 + 1e-9) * value * towards / spread
    return th


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
