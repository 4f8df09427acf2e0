"""What every design starts from: the sampled linear plant with its known delay and lag, and weights in its units."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from furuta_gym.plant import Plant
from furuta_gym.plant.dynamics import mass_matrix
from furuta_gym.plant.linearization import linearize, state_derivative
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import period_of

from .base import DesignError


@dataclass(frozen=True)
class Weights:
    """Bryson's rule: the deviations that shall cost the same, each entering the cost as its inverse square.

    q1, q2 [rad], v1, v2 [rad/s] (inf: not weighted), torque in the plant's unit.
    """

    q1: float = 0.7
    q2: float = 0.1
    v1: float = np.inf
    v2: float = np.inf
    torque: float = 1.0

    @classmethod
    def of(cls, plant: Plant) -> "Weights":
        """0.7 rad of arm, 0.1 rad of pendulum, and three times the torque that holds the pendulum at 0.1 rad.

        To hold it there the arm must accelerate at θ5 q2/θ3, which takes about θ1 θ5 q2/θ3: a torque in the plant's
        own unit, so the same weights serve every rig. At most half of what the motor gets.
        """
        th1, _, th3, _, th5 = plant.theta[:5]
        holding = th1 * abs(th5 / th3) * cls.q2 if th3 and th5 else np.inf
        return cls(torque=float(min(3.0 * holding, 0.5 * plant.supply)))

    @property
    def Q(self) -> NDArray[np.float64]:
        """State weights (4, 4) in the order q1, q2, q̇1, q̇2."""
        return np.diag([self.q1**-2, self.q2**-2, self.v1**-2, self.v2**-2])

    @property
    def R(self) -> NDArray[np.float64]:
        return np.array([[self.torque**-2]])


@dataclass(frozen=True)
class DesignModel:
    """x⁺ = A x + B τ + noise at the samples, x = [q1, q2 − q2e, q̇1, q̇2, lagged torque, past torques].

    τ is the deviation from `torque`, which with q2 = `q2e` holds the arm at zero (both zero without effects that
    push or tilt). The lagged torque is there when the plant carries `actuator_lag`, past torques when it carries
    `input_delay` (newest first; the last one may act in part). noise (n, n): covariance that the unknown torque of
    `torque_noise_intensity` adds in one sample.
    """

    A: NDArray[np.float64]
    B: NDArray[np.float64]
    noise: NDArray[np.float64]
    q2e: float
    torque: float
    sample_time: float

    @property
    def size(self) -> int:
        return self.A.shape[0]

    @property
    def C(self) -> NDArray[np.float64]:
        """Readings of the angles (2, n)."""
        return np.eye(2, self.size)

    def widened(self, Q: NDArray[np.float64]) -> NDArray[np.float64]:
        """State weights (4, 4) with zeros for the command path."""
        wide = np.zeros((self.size, self.size))
        wide[:4, :4] = Q
        return wide


def choose_sample_time(plant: Plant, sample_time: float | None) -> float:
    """The caller's, else the plant's, else 2 ms. Raises ArgumentError, a ValueError, unless it is 1 µs to 1 s."""
    return period_of(sample_time, plant.sample_time)


def design_plant_for(plant: Plant, given: Plant | str | os.PathLike[str] | None) -> Plant:
    """What controllers for `plant` are designed from: the plant given, else itself.

    Raises ValueError where their commands have different units."""
    design = plant if given is None else Plant.resolve(given)
    if design.unit != plant.unit:
        raise ValueError(
            f"the design plant's command is in {design.unit}, the plant's in {plant.unit}; they must agree"
        )
    return design


def choose_sensors(plant: Plant, sensors: Sensors | None) -> Sensors:
    """The caller's, else the plant file's, else 4096-count encoders."""
    return sensors if sensors is not None else Sensors.of_file(plant.sensors)


def torque_noise_intensity(plant: Plant) -> NDArray[np.float64]:
    """Intensities (2,) [{u}² s] of the torque that the linear model does not know.

    On the arm that is Coulomb friction, ±θ8, switching at the pace of the motion, about every 0.1 s. The pendulum's
    row also carries what linearization drops: three times θ9 there gave LQG the push tolerance of exact velocities
    (three rigs, 1024 and 4096 counts) at a third of the roughness. Floors keep the filter awake without friction.
    """
    gravity = abs(plant.theta[4])
    level = np.array([max(abs(plant.theta[7]), 0.01 * gravity), max(3.0 * abs(plant.theta[8]), 0.015 * gravity)])
    return level**2 * 0.1


def balance_point(plant: Plant) -> tuple[float, float]:
    """(q2e, τ): the pendulum angle near upright and the motor torque that leave the arm at rest at q1 = 0.

    Newton's method on the plant's own equations, without effects that have memory or follow time. Raises DesignError
    if there is none within 0.5 rad.
    """
    still = plant.keeping(lambda effect: not (effect.type.memory or effect.type.follows_clock))
    at = lambda z: state_derivative(still, np.array([0.0, z[0], 0.0, 0.0]), z[1])[2:4]  # noqa: E731
    z = np.zeros(2)
    for _ in range(20):
        base, h = at(z), np.array([1e-6, 1e-6 * plant.u_max])
        slope = np.stack([(at(z + np.diag(h)[i]) - base) / h[i] for i in range(2)], axis=1)
        try:
            step = np.linalg.solve(slope, base)
        except np.linalg.LinAlgError:  # a pendulum without weight: its angle changes nothing
            break
        z -= step
        if not abs(z[0]) < 0.5:
            break
        if np.all(np.abs(step) < 1e-9 * np.array([1.0, plant.u_max])):
            return float(z[0]), float(z[1])
    raise DesignError("this plant has no balance point near upright at q1 = 0; check the size of its effects")


def design_model(plant: Plant, sample_time: float) -> DesignModel:
    """The plant at its samples, linear about upright, with the delay and the lag that it carries.

    Raises DesignError if the command cannot reach the pendulum (θ3 = 0).
    """
    th1, th2, th3, th4 = plant.theta[:4]
    if th3 == 0:
        raise DesignError("θ3 = 0: the arm does not move the pendulum, so no controller can balance it")
    linear = linearize(plant)
    q2e, torque = balance_point(plant) if plant.effects else (0.0, 0.0)
    m11, m12, m22 = mass_matrix(0.0, th1, th2, th3, th4)
    inverse = np.linalg.inv(np.array([[m11, m12], [m12, m22]]))
    A, B, W = linear.A, linear.B, np.vstack([np.zeros((2, 2)), inverse])
    lag, delay = plant.effect("actuator_lag"), plant.effect("input_delay")
    if lag is not None and (tau := lag.parameters["T"]) > 0:
        A = np.block([[A, B], [np.zeros((1, 4)), np.full((1, 1), -1 / tau)]])
        B = np.vstack([np.zeros((4, 1)), [[1 / tau]]])
        W = np.vstack([W, np.zeros((1, 2))])
    T = sample_time
    noise = _sampled_noise(A, W @ np.diag(torque_noise_intensity(plant)) @ W.T, T)
    d = delay.parameters["d"] if delay is not None else 0.0
    m = int(np.ceil(d / T - 1e-9))
    if m == 0:
        Ad, Bd = _held(A, B, T)
    else:
        n = A.shape[0]
        late = d - (m - 1) * T  # for so long the oldest command still acts
        after, new = _held(A, B, T - late)
        whole = expm(A * T)
        old = after @ _held(A, B, late)[1]
        Ad, Bd = np.zeros((n + m, n + m)), np.zeros((n + m, 1))
        Ad[:n, :n] = whole
        Ad[:n, n + m - 1] = old[:, 0]
        Ad[n + 1 :, n : n + m - 1] = np.eye(m - 1)
        Bd[n] = 1.0
        if m == 1:
            Bd[:n] = new
        else:
            Ad[:n, n + m - 2] = new[:, 0]
        noise = np.pad(noise, (0, m))
    return DesignModel(Ad, Bd, noise, q2e, torque, T)


def _held(A: NDArray[np.float64], B: NDArray[np.float64], time: float) -> tuple[NDArray[np.float64], ...]:
    """(e^{A t}, ∫ e^{A s} ds B) for a command held over `time`."""
    n, m = B.shape
    E = np.asarray(expm(np.block([[A, B], [np.zeros((m, n + m))]]) * time), dtype=float)
    return E[:n, :n], E[:n, n:]


def _sampled_noise(A: NDArray[np.float64], Q: NDArray[np.float64], time: float) -> NDArray[np.float64]:
    """∫ e^{A s} Q e^{Aᵀ s} ds over one sample (Van Loan 1978)."""
    n = A.shape[0]
    E = np.asarray(expm(np.block([[-A, Q], [np.zeros((n, n)), A.T]]) * time), dtype=float)
    N = E[n:, n:].T @ E[:n, n:]
    return 0.5 * (N + N.T)


def riccati(solve: Callable[..., Any], *matrices: Any) -> Any:
    """What `solve` of python-control gives for these matrices. Raises DesignError where the equation has no solution.

    With parameters beyond any rig the matrices overflow or are singular, and python-control has several exceptions
    for that."""
    try:
        if not all(np.isfinite(matrix).all() for matrix in matrices):
            raise ValueError("a matrix has entries that are no numbers")
        try:
            return solve(*matrices)
        except ArithmeticError:  # slycot, where it is installed, gives up at some short sample times
            return solve(*matrices, method="scipy")
    except (ValueError, TypeError, ArithmeticError) as error:
        raise DesignError(f"no regulator exists for this plant; check the size of its parameters ({error})") from error
