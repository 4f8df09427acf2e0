"""Run a plant under a command or a policy, sampled as a rig's computer samples it."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .arguments import ArgumentError
from .plant.advance import advance
from .plant.effects import EFFECTS
from .plant.integration_step import substep
from .plant.plant import Plant
from .sensors import Sensors

LONGEST_STEP = 2e-3  # s; longest Runge–Kutta step, where friction allows it
DEFAULT_SAMPLE_TIME = 2e-3  # s, where neither the caller nor the plant says one
FALLEN = 1.0  # rad from upright; a run that shall balance ends there

MOST_STEPS = 10_000  # of integration in one sample; no rig needs a hundred
MOST_SAMPLES = 20_000_000  # of a run; five hours at 1 ms
_KEPT = 4096  # samples whose commands are kept at least, where the length of a run is not known
_LONGEST_DELAY = max(p.upper for p in EFFECTS["input_delay"].parameters)  # s
_BOUND = 1e6  # rad and rad/s


def integration_step(plant: Plant, longest_step: float, sample_time: float) -> float:
    """Longest Runge–Kutta step [s] for the plant's friction, see `substep`.

    Raises ValueError where a sample would take more than `MOST_STEPS` of them."""
    h_max = substep(max(plant.sharpest), plant.friction_rate, longest_step)
    if not sample_time <= MOST_STEPS * h_max:
        raise too_many_steps(sample_time, sample_time / h_max, None if h_max < longest_step else longest_step)
    return h_max


def too_many_steps(sample_time: float, steps: float, longest_step: float | None) -> ValueError:
    """What to raise where a sample takes more than `MOST_STEPS`. longest_step [s]: where that is why, else None."""
    why = (
        "the plant's friction (theta6 … theta9, friction_sharpness) is too stiff. Lower friction_sharpness or the "
        "sample time"
        if longest_step is None
        else f"longest_step is {longest_step:g} s. Raise it, or lower the sample time"
    )
    return ValueError(
        f"a sample of {sample_time:g} s would take {steps:.3g} steps of integration, at most {MOST_STEPS} are allowed: "
        f"{why}"
    )


def period_of(*given: float | None) -> float:
    """The first sample time [s] that is given, else 2 ms. Raises ArgumentError unless it is 1 µs to 1 s."""
    T = next((T for T in given if T is not None), DEFAULT_SAMPLE_TIME)
    if not 1e-6 <= T <= 1:
        raise ArgumentError("sample_time", repr(T), "expected seconds, from 1e-6 to 1")
    return float(T)


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
    """A policy that ignores the readings: a constant, or a sequence whose last value holds on.

    Raises ValueError for no value, or one that is not finite."""
    given = np.atleast_1d(np.asarray(values, dtype=float))
    if not given.size or not np.isfinite(given).all():
        raise ArgumentError("values", repr(values), "expected a finite number, or a sequence of them")
    return _OpenLoop(given)


class _OpenLoop:
    def __init__(self, values: NDArray[np.float64]):
        self._values, self._next = values, 0

    def reset(self) -> None:
        self._next = 0

    def __call__(self, y: NDArray[np.float64]) -> float:
        value = self._values[min(self._next, self._values.size - 1)]
        self._next += 1
        return float(value)


CLOCK_ROUNDING = 1e-3
"""A clock that was read from stamps carries their rounding, up to this part of its sample time."""


def same_clock(one: float, other: float) -> bool:
    """Whether two sample times [s] are the same, within `CLOCK_ROUNDING`."""
    return abs(one - other) <= CLOCK_ROUNDING * other


def check_clock(policy: Any, sample_time: float) -> None:
    """Raises ValueError where a controller is made for another sample time [s] than it is to be played at (see
    `same_clock`)."""
    own = getattr(policy, "sample_time", None)
    if own is not None and not same_clock(own, sample_time):
        raise ValueError(
            f"{getattr(policy, 'name', 'the controller')} is made for a sample time of {own:g} s and is to be played "
            f"at {sample_time:g} s. Make it for {sample_time:g} s, or play it at its own"
        )


class LivePlant:
    """One plant, its encoders and its clock. `read`, then `step`, once a sample.

    sample_time [s]: default is the plant's, else 2 ms. sensors: default is what the plant file says, else 4096 counts;
    they stay where the plant is exchanged. x0: q1, q2, q̇1, q̇2 [rad, rad/s]. seed: of the sensors' noise. samples: the
    length of the run where it is known. Raises ValueError where a sample takes too many steps, or an argument cannot
    be.
    """

    def __init__(
        self,
        plant: Plant,
        sample_time: float | None = None,
        sensors: Sensors | None = None,
        x0: ArrayLike = (0.0, 0.0, 0.0, 0.0),
        seed: int | np.random.Generator | None = 0,
        longest_step: float = LONGEST_STEP,
        samples: int = _KEPT,
    ) -> None:
        self.sample_time = period_of(sample_time, plant.sample_time)
        self.sensors = sensors or Sensors.of_file(plant.sensors)
        self.rng = np.random.default_rng(seed)
        self.samples = 0
        if not longest_step > 0:
            raise ArgumentError("longest_step", repr(longest_step), "expected seconds, above 0")
        self._longest_step = longest_step
        samples = max(samples, 2 * (math.ceil(_LONGEST_DELAY / self.sample_time) + 2))  # `_shift` keeps half of them
        self._row = 0  # the newest row of the commands
        self._U = np.zeros((samples + 1, 1))  # row 0: nothing is commanded before the run
        self._given = np.concatenate([[-np.inf], np.arange(samples, dtype=float) * self.sample_time])
        self._W = np.zeros((2, 1))
        self._take(plant)
        self._X = np.zeros((self._rows, 1))
        start = np.asarray(x0, dtype=float)
        if start.shape != (4,) or not np.isfinite(start).all():
            raise ArgumentError("x0", repr(x0), "expected finite q1, q2, q̇1, q̇2")
        self._X[:4, 0] = start

    @property
    def t(self) -> float:
        """Time since the start [s]."""
        return self.samples * self.sample_time

    @property
    def state(self) -> NDArray[np.float64]:
        """True q1, q2, q̇1, q̇2 (4,) [rad, rad/s]."""
        return self._X[:4, 0].copy()

    def read(self) -> NDArray[np.float64]:
        """What the encoders read now, (2,) [rad]."""
        return self.sensors.read(self._X, self._P, self._codes, self.rng)[:, 0]

    def step(self, command: float, torque: Sequence[float] | NDArray[np.float64] = (0.0, 0.0)) -> None:
        """Go on by one sample under a command [{u}], within supply and slew, and torques (2,) [{u}] on the two rows.

        Raises ValueError for a command that is NaN, FloatingPointError where the motion leaves all bounds."""
        if command != command:
            raise ValueError(f"the command at t = {self.t:.3f} s is NaN; check the controller that gave it")
        if self._row + 1 >= len(self._U):
            self._shift()
        self._row += 1
        t, T = self.t, self.sample_time
        most = self._slew * T
        command = min(max(command, -self._supply), self._supply)
        self._U[self._row, 0] = min(max(command, self._U[self._row - 1, 0] - most), self._U[self._row - 1, 0] + most)
        self._W[:, 0] = torque
        advance(self._X, t, t + T, self._given, self._U, self._row, self._W, self._P, self._codes, self._h_max)
        if not np.abs(self._X[:4, 0]).max() < _BOUND:
            raise FloatingPointError(f"the simulated motion leaves all bounds at t = {t:.3f} s: {self.plant}")
        self.samples += 1

    @property
    def command(self) -> float:
        """The newest command [{u}], as it was clipped."""
        return float(self._U[self._row, 0])

    def exchange(self, plant: Plant) -> None:
        """Go on as another plant from the same angles and speeds; effects that it has as well keep their memory."""
        before, X = dict(_memory_rows(self.plant)), self._X
        self._take(plant)
        self._X = np.zeros((self._rows, 1))
        self._X[:4] = X[:4]
        for name, rows in _memory_rows(plant):
            if name in before:
                self._X[rows] = X[before[name]]

    def _take(self, plant: Plant) -> None:
        self._h_max = integration_step(plant, self._longest_step, self.sample_time)
        p, self._codes, self._rows = plant.packed()
        self._P = p[:, None]
        self._supply, self._slew = plant.supply, plant.limit("slew", np.inf)
        self.plant = plant

    def _shift(self) -> None:
        """Forget the older half of the commands."""
        half = (len(self._U) - 1) // 2
        self._U[1 : half + 1] = self._U[-half:]
        self._row = half
        self._given[1:] = (np.arange(len(self._U) - 1, dtype=float) + self.samples - half) * self.sample_time


def _memory_rows(plant: Plant) -> Iterator[tuple[str, slice]]:
    """The rows of the state in which each effect remembers, in the plant's order."""
    for effect, (_, _, first) in zip(plant.effects, plant.packed().codes, strict=True):
        yield effect.name, slice(first, first + len(effect.type.memory))


def simulate(
    plant: Plant | str,
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
    """Simulate `duration` seconds with commands u = policy(y) + d(t) held for `sample_time`.

    Commands stay within ±u_max, and within the supply and the slew of the plant's limits where it has them.

    plant: a `Plant`, a plant file or a known set.
    policy: called with readings y (2,) [rad] once a sample, gives the command [{u}]; `open_loop()` commands nothing.
    sample_time [s]: default is the controller's own, else the plant's. sensors: default is what the plant file says,
    else 4096-count encoders. excitation: d(t) as a function of an array of times or as one value a sample. x0: q1, q2,
    q̇1, q̇2. torque_noise: intensities [{u}² s] of white torque on the two rows, held over each sample. Stops early when
    |q2| passes q2_limit [rad]. Raises ValueError on impossible durations or excitations, a controller made for another
    sample time or one whose command is NaN, or a sample of more than `MOST_STEPS` steps, and FloatingPointError if the
    motion leaves all bounds.
    """
    plant = Plant.resolve(plant)
    T = period_of(sample_time, getattr(policy, "sample_time", None), plant.sample_time)
    check_clock(policy, T)
    n = round(duration / T) if np.isfinite(duration) else 0
    if n < 1:
        raise ValueError(f"duration must be finite and hold at least one sample of {T:g} s, got {duration!r}")
    if n > MOST_SAMPLES:
        raise ValueError(f"{duration:g} s at {T:g} s are {n:.3g} samples; expected at most {MOST_SAMPLES}")
    if not q2_limit > 0:
        raise ValueError(f"q2_limit must be an angle above 0 [rad], got {q2_limit!r}")
    if not (np.isfinite(torque_noise).all() and np.min(torque_noise) >= 0):
        raise ValueError(f"torque_noise must be two finite numbers that are not negative, got {torque_noise!r}")
    rng = np.random.default_rng(seed)
    t = np.arange(n, dtype=float) * float(T)
    d = _excitation(excitation, t)
    live = LivePlant(plant, T, sensors, x0, rng, longest_step, samples=n)
    noise_std = np.sqrt(np.asarray(torque_noise, dtype=float) / T)
    state, measured, command = np.empty((n, 4)), np.empty((n, 2)), np.empty(n)
    reset = getattr(policy, "reset", None)
    if reset is not None:
        reset()
    end, fell = n, None
    for k in range(n):
        state[k] = live.state
        if not abs(state[k, 1]) <= q2_limit:
            end, fell = k, t[k]
            break
        measured[k] = live.read()
        live.step(policy(measured[k]) + d[k], rng.standard_normal(2) * noise_std)
        command[k] = live.command
    return Simulation(t[:end], state[:end], measured[:end], command[:end], fell)


def _excitation(excitation: Any, t: NDArray[np.float64]) -> NDArray[np.float64]:
    if excitation is None:
        return np.zeros_like(t)
    d = np.asarray(excitation(t) if callable(excitation) else excitation, dtype=float)
    if d.shape != t.shape:
        raise ValueError(f"the excitation must give one number a sample: {t.shape}, got {d.shape}")
    if not np.isfinite(d).all():
        k = int(np.argmin(np.isfinite(d)))
        raise ValueError(f"the excitation must give finite numbers, got {d[k]} at t = {t[k]:.3f} s; check its values")
    return d
