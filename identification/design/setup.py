"""An experiment before it is made: the loop it runs in, the limits it must keep, the log it would give.

A `Setup` is everything about an experiment but its excitation. The controller is handed in, because identification
knows none; without one the pendulum hangs and the excitation is the whole command.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import Plant
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import Policy, check_clock, open_loop, simulate

from ..kalman.record import Record
from .signals import Scaled, Signal

MARGIN = 0.95  # of a limit that a design may use: other noise, and a rig that is not quite the plant, need the rest
_BY_HAND = 0.01  # rad from upright, where a run starts: nobody sets a pendulum up exactly
_ROUNDS = 12  # of scaling an excitation to its limits
_AIM = 0.985  # of the allowed size
_CLOSE = 0.97  # of the allowed size, from which no further round is worth it


@dataclass(frozen=True)
class Limits:
    """What an experiment must not exceed: |q1| [rad], |q2| [rad] from where the pendulum rests (upright, or hanging
    without a controller), the command |u| [{u}] and its change |u̇| [{u}/s] from sample to sample."""

    q1: float = 1.5
    q2: float = 1.5
    u: float = math.inf
    u_rate: float = math.inf

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not value > 0:
                raise ValueError(f"limit of {name} must be a positive number, got {value!r}")

    def within(self, other: Limits) -> Limits:
        """The tighter of the two, one by one."""
        return Limits(
            *(min(mine, theirs) for mine, theirs in zip(vars(self).values(), vars(other).values(), strict=True))
        )


@dataclass(frozen=True)
class Run:
    """One simulated run: t (n,) [s], readings (n, 2) [rad], command (n,), the largest |q1|, |q2|, |u|, |u̇| (4,) of
    the true motion, and when the pendulum fell [s], or None."""

    t: NDArray[np.float64]
    measured: NDArray[np.float64]
    command: NDArray[np.float64]
    largest: NDArray[np.float64]
    fell: float | None

    def excess(self, limits: Limits) -> float:
        """Largest size over its limit; 1 is just allowed. A fall counts as twice the limit of q2 at least."""
        ratio = float(np.max(self.largest / np.array([limits.q1, limits.q2, limits.u, limits.u_rate])))
        return ratio if self.fell is None else max(ratio, 2.0)

    def beyond(self, limits: Limits) -> str:
        """The size that is furthest over its limit, in words."""
        allowed = [limits.q1, limits.q2, limits.u, limits.u_rate]
        names = ("the arm turns", "the pendulum swings", "the command reaches", "the command changes by")
        units = ("rad", "rad", "", "a second")
        at = int(np.argmax(self.largest / np.array(allowed)))
        return (
            f"{names[at]} {self.largest[at]:.3g} {units[at]}".rstrip() + f", more than the limit of {allowed[at]:.3g}"
        )


@dataclass(frozen=True)
class Setup:
    """A rig ready for an experiment.

    policy: the balancing controller, called with readings once a sample; None lets the pendulum hang. torque_noise
    (2,): intensities [{u}² s]. offset [rad]: where the pendulum starts from its rest.
    """

    plant: Plant
    policy: Policy | None
    duration: float = 20.0
    sample_time: float = 0.002
    sensors: Sensors = Sensors()  # noqa: RUF009  (a frozen value)
    torque_noise: tuple[float, float] = (0.0, 0.0)
    offset: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.duration) and self.sample_time > 0 and 50 * self.sample_time <= self.duration):
            raise ValueError(
                f"an experiment needs at least 50 samples, got {self.duration:g} s at {self.sample_time:g} s a sample"
            )
        check_clock(self.policy, self.sample_time)

    @classmethod
    def of(cls, plant: Plant, policy: Policy | None, duration: float = 20.0, sample_time: float | None = None) -> Setup:
        """As the plant file says: its sample time (default 2 ms), its sensors, the torque noise of its fit.

        A plant that no log was fitted to gets `assumed_torque_noise`.
        """
        sensors = Sensors.of_file(plant.sensors)
        found = plant.provenance.get("torque_noise")
        noise = (float(found[0]), float(found[1])) if found else assumed_torque_noise(plant)
        off = _BY_HAND if policy is not None else 0.0
        T = float(sample_time or getattr(policy, "sample_time", None) or plant.sample_time or 0.002)
        return cls(plant, policy, duration, T, sensors, noise, off)

    @property
    def size(self) -> float:
        """The factor of a signal from which a design starts: 1 for the command of ±10 V that the paper's d(t) is for,
        in proportion for others."""
        return 0.1 * self.plant.u_max

    @property
    def usual_limits(self) -> Limits:
        """1.5 rad of arm, 0.3 rad about upright or 1.5 rad about hanging, and what the rig bears."""
        return Limits(q2=0.3 if self.policy is not None else 1.5).within(self.rig_limits)

    @property
    def rig_limits(self) -> Limits:
        """What the plant says that its rig bears (`Plant.limits`), and no saturation of the command. Its `arm_speed` is
        none of them: a design keeps to angles and the command; `export` and `compare` keep to it."""
        rig = self.plant
        return Limits(rig.limit("arm_travel", math.inf), math.inf, rig.supply, rig.limit("slew", math.inf))

    @property
    def rest(self) -> float:
        """Where the pendulum rests [rad]."""
        return 0.0 if self.policy is not None else math.pi

    def run(self, signal: Signal | None, seed: int = 0, plant: Plant | None = None) -> Run:
        """Simulate the experiment under an excitation; `plant`: another plant than the setup's in the same loop."""
        result = simulate(
            plant or self.plant,
            self.policy or open_loop(0.0),
            self.duration,
            self.sample_time,
            self.sensors,
            signal,
            x0=(0.0, self.rest + self.offset, 0.0, 0.0),
            torque_noise=self.torque_noise,
            seed=seed,
            q2_limit=1.0 if self.policy is not None else math.inf,
        )
        u = result.command
        rate = float(np.max(np.abs(np.diff(u)), initial=0.0)) / self.sample_time
        swing = np.abs(result.state[:, 1] - self.rest)
        largest = np.array([np.abs(result.state[:, 0]).max(), swing.max(), np.abs(u).max(), rate])
        return Run(result.t, result.measured, u, largest, result.fell)

    def record(self, run: Run) -> Record:
        """The run as the filters take it: noise as the sensors have it, rounding included."""
        quantum = self.sensors.resolution
        variance = np.maximum(np.square(self.sensors.noise_std) + quantum**2 / 12.0, 1e-14)
        return Record.from_arrays(run.t, run.measured, run.command, variance, quantum)

    def shortened(self, duration: float) -> Setup:
        """The same for at most `duration` seconds."""
        return replace(self, duration=min(self.duration, duration))


def assumed_torque_noise(plant: Plant) -> tuple[float, float]:
    """Intensities [{u}² s] where no fit tells them: a twentieth of each axis's Coulomb friction for 10 ms.

    Not below a ten-thousandth of the weight's moment.
    """
    least = 1e-4 * abs(plant.theta[4])
    arm, pendulum = (0.01 * max(0.05 * abs(f), least) ** 2 for f in plant.theta[[7, 8]])
    return float(arm), float(pendulum)


@dataclass(frozen=True)
class _Tried:
    """An excitation at a factor, and its largest size over `MARGIN` of the limits."""

    factor: float
    excess: float
    run: Run


def sized(
    setup: Setup, signal: Signal, limits: Limits, seed: int = 0, most: float = math.inf, rounds: int = _ROUNDS
) -> Iterator[_Tried]:
    """A signal at factors that approach the largest one, at most `most`, that keeps `MARGIN` of the limits.

    In proportion until one factor keeps them and one does not. Dry friction makes a motion begin at a threshold, so
    from then on the next factor lies well between these two.
    """
    below: _Tried | None = None
    above: _Tried | None = None
    factor, failed = min(setup.size, most), 0
    for _ in range(rounds):
        run = setup.run(Scaled(signal, factor), seed)
        tried = _Tried(factor, run.excess(limits) / MARGIN, run)
        yield tried
        if tried.excess <= 1.0:
            below = tried
            if tried.excess > _CLOSE or factor >= most:
                return
        else:
            above, failed = tried, failed + 1
        if below is None:
            # a command that is clipped never exceeds its limit by much
            factor *= _AIM / tried.excess * 0.5 ** (failed - 1)
        elif above is None:
            factor *= _AIM / max(tried.excess, 0.05)
        elif above.factor < 1.02 * below.factor:
            return
        else:
            low, high = (math.log(max(t.excess, 1e-3)) for t in (below, above))
            part = min(max((math.log(_AIM) - low) / (high - low), 0.2), 0.8)
            factor = below.factor * (above.factor / below.factor) ** part
        factor = min(factor, most)


def within_limits(setup: Setup, signal: Signal, limits: Limits, seed: int = 0, most: float = math.inf) -> Scaled:
    """The signal times the largest factor (at most `most`) that keeps a simulated run within `MARGIN` of the limits.

    Raises ValueError where even a very small excitation breaks a limit.
    """
    tried = sized(setup, signal, limits, seed, most)
    low = max((t.factor for t in tried if t.excess <= 1.0), default=0.0)
    if low == 0.0:
        _explain(setup, limits, seed)
        way = "excite more slowly, or widen them if the rig allows it"
        raise ValueError(f"no size of this excitation keeps the limits; {way}")
    return Scaled(signal, low)


def _explain(setup: Setup, limits: Limits, seed: int) -> None:
    """Raise ValueError if the loop breaks a limit without any excitation."""
    quiet = setup.run(None, seed)
    if quiet.excess(limits) <= MARGIN:
        return
    if quiet.fell is not None:
        raise ValueError(f"the controller does not hold this plant up: it falls after {quiet.fell:.2f} s, unexcited")
    names = ("|q1|", "|q2|", "|u|", "|u̇|")
    sizes = (limits.q1, limits.q2, limits.u, limits.u_rate)
    broken = [
        f"{name} reaches {size:.3g}, the limit is {limit:g}"
        for name, size, limit in zip(names, quiet.largest, sizes, strict=True)
        if size > MARGIN * limit
    ]
    if setup.policy:
        what, way = "the loop", "widen them if the rig allows it"
    else:
        what = "the rig, hanging and moved by the plant file's torque noise alone,"
        way = (
            "that noise is what the fitted model misses: find it with `furuta diagnose`, and design on the plant.json "
            "that it writes"
        )
    raise ValueError(f"without any excitation {what} already passes its limits ({'; '.join(broken)}); {way}")
