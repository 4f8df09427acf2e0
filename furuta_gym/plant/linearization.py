"""The plant near an equilibrium, as matrices."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .integration import rates
from .layout import N_BASE
from .plant import Plant

UPRIGHT, HANGING = 0.0, np.pi


@dataclass(frozen=True)
class Linearization:
    """ẋ = A (x − x̄) + B (τ − τ̄) with x = [q1, q2, q̇1, q̇2]; A (4, 4), B (4, 1)."""

    A: NDArray[np.float64]
    B: NDArray[np.float64]
    x: NDArray[np.float64]
    tau: float

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Eigenvalues of A [1/s]."""
        return np.linalg.eigvals(self.A).astype(complex)


def state_derivative(plant: Plant, x: NDArray[np.float64], tau: float, t: float = 0.0) -> NDArray[np.float64]:
    """dx/dt (4 + memory,) of state x under motor torque tau: the compiled model at one point."""
    p, codes, rows = plant.packed()
    X = np.zeros((rows, 1))
    X[: len(x), 0] = x
    K = np.zeros_like(X)
    one = np.zeros(1)
    rates(one + t, X, one + tau, np.zeros((2, 1)), p[:, None], codes, np.empty((N_BASE, 1)), np.empty((2, 1)), K)
    return K[:, 0]


def linearize(plant: Plant, q2: float = UPRIGHT, q1: float = 0.0, coulomb: bool = False) -> Linearization:
    """Linearize about rest at arm angle q1 and q2 = 0 (upright) or π (hanging), effects on the two rows included.

    The slope of tanh at rest (θ8 r, θ9 r, and that of the effects' friction) belongs to motions smaller than 1/r only;
    controllers are designed without it, as in the paper. `coulomb=True` keeps it. The motor torque that holds the arm
    there is found too.
    Effects with memory and on the command do not enter (they are dynamics of their own). Raises ValueError if q2
    is not an equilibrium.
    """
    if not abs(np.sin(q2)) < 1e-9:
        raise ValueError(f"q2 = {q2:g} rad is no equilibrium; use 0 (upright) or π (hanging)")
    plant = plant.keeping(lambda effect: not effect.type.memory)
    if not coulomb:
        plant = plant.replace(theta=np.concatenate([plant.theta[:7], [0.0, 0.0]]))
        plant = plant.keeping(lambda effect: not effect.type.dry)
    x = np.array([q1, q2, 0.0, 0.0])
    base = state_derivative(plant, x, 0.0)
    B = (state_derivative(plant, x, 1.0) - base)[:, None]
    tau = float(-(B[2:, 0] @ base[2:]) / (B[2:, 0] @ B[2:, 0]))
    A = np.empty((4, 4))
    for i in range(4):
        # even steps leave an O(h²) error; tanh needs h far below 1/r
        h = 1e-6 if i < 2 else 1e-3 / max(plant.sharpness)
        step = np.zeros(4)
        step[i] = h
        A[:, i] = (state_derivative(plant, x + step, tau) - state_derivative(plant, x - step, tau)) / (2 * h)
    return Linearization(A, B, x, tau)


def discretize(linear: Linearization, sample_time: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(A_d, B_d) for a command held over `sample_time` [s] (zero-order hold)."""
    from scipy.signal import cont2discrete

    if not sample_time > 0:
        raise ValueError(f"sample_time must be positive, got {sample_time!r}")
    system = (linear.A, linear.B, np.eye(4), np.zeros((4, 1)))
    A, B, *_ = cont2discrete(system, sample_time)  # type: ignore[misc]
    return np.asarray(A), np.asarray(B)
