"""A linear sampled controller as data: one law for LQR, LQG, integral action, pole placement and H∞ alike."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import Plant
from furuta_gym.sensors import Sensors, difference_gain

from ..base import Controller, Reference
from ..design import DesignModel, choose_sensors, design_model
from ..known_effects import KnownEffects


@dataclass(frozen=True)
class LinearLaw:
    """At each sample, with w = (q1, q2, r) and the torque limited to what the motor gives:

        τ = sat(C z + D w),   z⁺ = A z + B w + G τ,   and before the first sample z = Z (q1, q2).

    A (n, n), B (n, 3), G (n,), C (n,), D (3,), Z (n, 2). G carries the torque that was really applied: observers
    need it, and integrators unwind by it. The estimated state q1, q2, q̇1, q̇2 is E z + F w, E (4, n), F (4, 3).
    """

    A: NDArray[np.float64]
    B: NDArray[np.float64]
    G: NDArray[np.float64]
    C: NDArray[np.float64]
    D: NDArray[np.float64]
    Z: NDArray[np.float64]
    E: NDArray[np.float64]
    F: NDArray[np.float64]

    @property
    def size(self) -> int:
        return self.C.size


def state_feedback(
    K: NDArray[np.float64], model: DesignModel, velocity_cutoff: float, command_path: bool = True
) -> LinearLaw:
    """τ = −K x + K1 r with velocities by the filtered difference; K (n,) over the model's states.

    z = [last readings, last velocities, command path]; the command path is known, as we send the commands.
    """
    T = model.sample_time
    g = difference_gain(velocity_cutoff, T)
    m = model.size - 4 if command_path else 0
    n = 4 + m
    E, F = np.zeros((4, n)), np.zeros((4, 3))
    F[:2, :2] = np.eye(2)
    E[2:, :2], E[2:, 2:4], F[2:, :2] = -g / T * np.eye(2), (1 - g) * np.eye(2), g / T * np.eye(2)
    A, B, G = np.zeros((n, n)), np.zeros((n, 3)), np.zeros(n)
    A[:4], B[:4] = E, F
    A[4:, 4:], G[4:] = model.A[4:n, 4:n], model.B[4:n, 0]
    C = -K[:4] @ E
    C[4:] -= K[4:n]
    D = -K[:4] @ F + np.array([0.0, 0.0, K[0]])
    return LinearLaw(A, B, G, C, D, np.eye(n, 2), E, F)


def observer_feedback(K: NDArray[np.float64], L: NDArray[np.float64], model: DesignModel) -> LinearLaw:
    """τ = −K x̂ + K1 r, x̂ = x⁻ + L (y − x⁻), x⁻ = A x̂ + B τ: a Kalman filter in its current form; L (n, 2).

    z = x⁻, the state predicted from the samples before.
    """
    n = model.size
    keep = np.eye(n) - L @ model.C
    wide = np.hstack([L, np.zeros((n, 1))])
    D = -K @ wide + np.array([0.0, 0.0, K[0]])
    return LinearLaw(model.A @ keep, model.A @ wide, model.B[:, 0], -K @ keep, D, np.eye(n, 2), keep[:4], wide[:4])


class LinearController(Controller):
    """Plays a `LinearLaw` on a plant: known reading errors are undone before it, the static command path after it.

    sensors: the encoders, by default the plant file's, else 4096 counts. friction_share: that share of the arm's
    Coulomb friction, and of the arm's known effects, is cancelled at the estimated state, smooth about standstill.
    """

    def __init__(
        self,
        name: str,
        law: LinearLaw,
        plant: Plant,
        model: DesignModel,
        *,
        sensors: Sensors | None = None,
        reference: Reference = 0.0,
        friction_share: float = 0.0,
    ) -> None:
        super().__init__(name, model.sample_time, plant.supply, reference)
        self.law = law
        self.plant = plant
        self.sensors = choose_sensors(plant, sensors)
        self.known = KnownEffects(plant, self.sensors)
        self.q2e, self.holding_torque = model.q2e, model.torque
        self.friction_share = friction_share
        self.limits = self.known.limits_about(self.holding_torque, name)
        self._matrix = np.block([[law.A, law.B], [law.C[None], law.D[None]], [law.E, law.F]])
        self._start()

    def _start(self) -> None:
        self._z: NDArray[np.float64] | None = None

    def _command(self, y: NDArray[np.float64], reference: float) -> Any:
        law, n = self.law, self.law.size
        q = self.known.angles(y)
        if self.q2e:
            q = np.stack([q[0], q[1] - self.q2e])
        if self._z is None:
            self._z = law.Z @ q
        zw = np.empty((n + 3, *q.shape[1:]))
        zw[:n], zw[n : n + 2], zw[n + 2] = self._z, q, reference
        out = self._matrix @ zw
        torque = np.minimum(np.maximum(out[n], self.limits[0]), self.limits[1])
        self._z = out[:n] + np.multiply.outer(law.G, torque)
        torque = torque + self.holding_torque
        if self.friction_share:
            torque = torque - self.friction_share * self.known.arm_torque(out[n + 1 :])
        return self.known.command(torque)

    def closed_loop_poles(self, plant: Plant | None = None) -> NDArray[np.complex128]:
        """Poles z of this controller on `plant` (default: its own), linear about upright; stable inside |z| = 1."""
        model = design_model(plant or self.plant, self.sample_time)
        law = self.law
        B, D = law.B[:, :2] @ model.C, law.D[:2] @ model.C
        C_u, D_u = law.C, D
        if self.friction_share:  # what it cancels of the arm's effects; model (5)'s Coulomb friction is not linear
            slopes = self.friction_share * self.known.effect_slopes()
            C_u, D_u = C_u - slopes @ law.E, D_u - slopes @ law.F[:, :2] @ model.C
        loop = np.block(
            [
                [model.A + model.B @ D_u[None], model.B @ C_u[None]],
                [B + np.outer(law.G, D), law.A + np.outer(law.G, law.C)],
            ]
        )
        return np.linalg.eigvals(loop).astype(complex)


def build_state_feedback(
    name: str, K: NDArray[np.float64], model: DesignModel, plant: Plant, sensors: Sensors, **options: Any
) -> LinearController:
    """A `LinearController` that feeds back [q1, q2, q̇1, q̇2] (and the command path, when K is that long)."""
    K = np.asarray(K, dtype=float).ravel()
    law = state_feedback(K, model, sensors.velocity_cutoff, command_path=K.size > 4)
    controller = LinearController(name, law, plant, model, sensors=sensors, **options)
    if K.size == 4 and not plant.effects and not controller.known.offset.any():
        q1, q2, v1, v2 = map(float, K)
        controller.feedback_gain = q1, v1, q2, v2
    return controller
