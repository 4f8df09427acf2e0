"""Run a plant under a command or a policy, sampled as a rig's computer samples it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .plant.dynamics import advance, substep
from .plant.plant import Plant
from .sensors import Sensors

LONGEST_STEP = 2e-3  # s; longest Runge–Kutta step, where the friction's sharpness allows it
FALLEN = 1.0  # rad from upright; a run that shall balance ends there

MOST_STEPS = 10_000  # of integration in one sample; no rig needs a hundred


def integration_step(sharpest: float, longest_step: float, sample_time: float) -> float:
    """Longest Runge–Kutta step [s] for friction of this sharpness [s/rad], see `substep`.

    Raises ValueError where a sample would take more than `MOST_STEPS` of them."""
    h_max = substep(sharpest, longest_step)
    if not sample_time <= MOST_STEPS * h_max:
        raise ValueError(
            f"a sample of {sample_time:g} s would take {sample_time / h_max:.3g} steps of integration, at most "
            f"{MOST_STEPS} are allowed: friction_sharpness {sharpest:g} s/rad is too sharp for it; lower one of them"
        )
    return h_max


@runtime_checkable
class Policy(Protocol):
    """Anything that turns encoder readings y = (q1, q2) [rad] at a sample into a command; state is its own affair."""

    def reset(self) -> None: ...

    def __call__(self, y: NDArray[np.float64]) -> float: ...


@dataclass(frozen=True)
class Simulation:
    """A run: t (n,) [s], state (n, 4) true q1, q2, q̇1, q̇2, measured (n, 2) readings, command (n,) held from t on.

    `fell` is the time at which |q2| first left the limit given to `simulate`, or None; the arrays end there.
    """

    t: NDArray[np.float64]
    state: NDArray[np.float64]
    measured: NDArray[np.float64]
    command: NDArray[np.float64]
    fell: float | None = None

    def __len__(self) -> int:
        return self.t.size


def open_loop(values: Sequence[float] | NDArray[np.float64] | float = 0.0) -> Callable[[NDArray[np.float64]], float]:
    """A policy that ignores the readings: a constant, or a sequence whose last value holds on."""
    return _OpenLoop(np.atleast_1d(np.asarray(values, dtype=float)))


class _OpenLoop:
    def __init__(self, values: NDArray[np.float64]):
        self._values, self._next = values, 0

    def reset(self) -> None:
        self._next = 0

    def __call__(self, y: NDArray[np.float64]) -> float:
        value = self._values[min(self._next, self._values.size - 1)]
        self._next += 1
        return float(value)


def check_clock(policy: Any, sample_time: float) -> None:
    """Raises ValueError where a controller is made for another sample time [s] than it is to be played at.

    Within 0.1 % they are the same: a clock that was read from stamps carries their rounding."""
    own = getattr(policy, "sample_time", None)
    if own is not None and abs(own - sample_time) > 1e-3 * sample_time:
        raise ValueError(
            f"{getattr(policy, 'name', 'the controller')} is made for a sample time of {own:g} s and is to be played "
            f"at {sample_time:g} s; make it for {sample_time:g} s, or play it at its own"
        )


def simulate(
    plant: Plant,
    policy: Callable[[NDArray[np.float64]], float],
    duration: float,
    sample_time: float | None = None,
    sensors: Sensors | None = None,
    excitation: Callable[[NDArray[np.float64]], NDArray[np.float64]] | ArrayLike | None = None,
    x0: ArrayLike = (0.0, 0.0, 0.0, 0.0),
    torque_noise: tuple[float, float] = (0.0, 0.0),
    seed: int | np.random.Generator | None = 0,
    q2_limit: float = np.inf,
    longest_step: float = LONGEST_STEP,
) -> Simulation:
    """Simulate `duration` seconds with commands u = clip(policy(y) + d(t), ±u_max) held for `sample_time`.

    policy: called with readings y (2,) [rad] once a sample, gives the command [{u}]; `open_loop()` commands nothing.
    sample_time [s]: default is the controller's own, else the plant's. sensors: default 4096-count encoders.
    excitation: d(t) as a function of an array of times or as one value a sample. x0: q1, q2, q̇1, q̇2. torque_noise:
    intensities [{u}² s] of white torque on the two rows, held over each sample. Stops early when |q2| passes q2_limit
    [rad]. Raises ValueError on impossible durations or excitations, a controller made for another sample time, or a
    sample of more than `MOST_STEPS` steps, and FloatingPointError if the motion leaves all bounds.
    """
    T = float(sample_time or getattr(policy, "sample_time", None) or plant.sample_time or 0.002)
    check_clock(policy, T)
    n = round(duration / T)
    if not (np.isfinite(duration) and n >= 1):
        raise ValueError(f"duration must hold at least one sample of {T:g} s, got {duration!r}")
    sensors = sensors or Sensors()
    rng = np.random.default_rng(seed)
    t = np.arange(n, dtype=float) * float(T)
    d = _excitation(excitation, t)
    p, codes, rows = plant.packed()
    P = p[:, None]
    X = np.zeros((rows, 1))
    X[:4, 0] = np.asarray(x0, dtype=float)
    held, U = np.concatenate([[-np.inf], t]), np.zeros((n + 1, 1))  # nothing is commanded before the run
    W = np.zeros((2, 1))
    noise_std = np.sqrt(np.asarray(torque_noise, dtype=float) / T)
    state, measured = np.empty((n, 4)), np.empty((n, 2))
    h_max = integration_step(plant.sharpest, longest_step, T)
    reset = getattr(policy, "reset", None)
    if reset is not None:
        reset()
    end, fell = n, None
    for k in range(n):
        state[k] = X[:4, 0]
        if not abs(X[1, 0]) <= q2_limit:
            end, fell = k, t[k]
            break
        measured[k] = sensors.read(X, P, codes, rng)[:, 0]
        U[k + 1, 0] = min(max(policy(measured[k]) + d[k], -plant.u_max), plant.u_max)
        W[:, 0] = rng.standard_normal(2) * noise_std
        advance(X, t[k], t[k] + T, held, U, k + 1, W, P, codes, h_max)
        if not np.abs(X[:4, 0]).max() < 1e6:
            raise FloatingPointError(f"the simulated motion leaves all bounds at t = {t[k]:.3f} s: {plant}")
    return Simulation(t[:end], state[:end], measured[:end], U[1 : end + 1, 0], fell)


def _excitation(excitation: Any, t: NDArray[np.float64]) -> NDArray[np.float64]:
    if excitation is None:
        return np.zeros_like(t)
    d = np.asarray(excitation(t) if callable(excitation) else excitation, dtype=float)
    if d.shape != t.shape or not np.isfinite(d).all():
        raise ValueError(f"the excitation must give one finite number a sample: {t.shape}, got {d.shape}")
    return d
