"""What the bench's own computer does: feedback from encoder counts alone, and the design of its gains."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_continuous_are

from .sets import ParameterSet


def linear_model(s: ParameterSet) -> tuple[np.ndarray, np.ndarray]:
    """(A, b) about upright in the order q1, q̇1, q2, q̇2; viscous friction only."""
    th1, _, th3, th4, th5 = s.inertia
    mass = np.array([[th1, th3], [th3, th4]])
    # M q̈ = (u, 0) + (0, θ5 q2) − Fv q̇
    right = np.array([[0.0, -s.viscous[0], 0.0, 0.0, 1.0], [0.0, 0.0, th5, -s.viscous[1], 0.0]])
    rates = np.linalg.solve(mass, right)
    a = np.zeros((4, 4))
    a[0, 1] = a[2, 3] = 1.0
    a[1], a[3] = rates[0, :4], rates[1, :4]
    return a, np.array([0.0, rates[0, 4], 0.0, rates[1, 4]])


def lqr_gain(s: ParameterSet) -> np.ndarray:
    """(4,) K of u = −K x for x = (q1, q̇1, q2, q̇2).

    Bryson's rule: 0.4 rad on the arm, 0.2 rad on the pendulum, 4 rad/s, and twice the excitation as command. Rounded
    to six digits: the last ones differ between processors, and within seconds feedback makes another run of that.
    """
    a, b = linear_model(s)
    weights = np.diag([1 / 0.4**2, 1 / 4.0**2, 1 / 0.2**2, 1 / 4.0**2])
    effort = 1 / (2.0 * s.drive) ** 2
    p = solve_continuous_are(a, b[:, None], weights, [[effort]])
    return np.array([float(f"{k:.6g}") for k in (b @ p) / effort])


class Balance:
    """u = −K (x − x_ref), speeds by a filtered difference (backward Euler, `bandwidth` in rad/s)."""

    def __init__(self, gain, bandwidth: float = 100.0):
        self.gain = tuple(float(k) for k in gain)
        self.bandwidth = bandwidth
        self.reset()

    def reset(self) -> None:
        """Forget the filter's state; call before a new run."""
        self._last: tuple[float, float] | None = None
        self._v1 = self._v2 = 0.0

    def command(self, y: tuple[float, float], dt: float, reference: tuple[float, float] = (0.0, 0.0)) -> float:
        """Command for readings y [rad], dt [s] after the last ones; reference: arm angle and speed."""
        if self._last is not None:
            w = self.bandwidth
            self._v1 = (self._v1 + w * (y[0] - self._last[0])) / (1.0 + w * dt)
            self._v2 = (self._v2 + w * (y[1] - self._last[1])) / (1.0 + w * dt)
        self._last = y
        k1, k2, k3, k4 = self.gain
        return -(k1 * (y[0] - reference[0]) + k2 * (self._v1 - reference[1]) + k3 * y[1] + k4 * self._v2)
