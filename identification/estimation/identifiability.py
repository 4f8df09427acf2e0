"""What a log can tell: gates before any number is computed, and the weak directions of a fit, in words.

Gates look at the motion alone: a held axis, a constant command or a motion of a few encoder counts leave parameters
without any information. After a fit, the Fisher information in relative parameters tells the rest: its smallest
singular values are the directions that the log hardly excites.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from ..logs.log import Log

_COUNTS = 12.0  # an axis that moves by less than this many noise standard deviations tells nothing of its dynamics
_SMALLEST = 2e-3  # rad
_SHORTEST = 1.0  # s
WEAK, LOST = 0.3, 1.0  # relative standard deviations from which a parameter is called weak, or not identified

PENDULUM = ("theta2", "theta3", "theta4", "theta5", "theta7", "theta9")
"""Of the pendulum's row, which has no input: they share a scale."""
EVERYTHING = tuple(f"theta{i}" for i in range(1, 10))
_BY_PULL = PENDULUM[1:]  # only the pendulum's pull on the arm shows their scale; θ2 is in the arm's inertia too


class NotIdentifiable(ValueError):
    """The logs cannot tell some parameters at all. `verdict` says which, why and what to do."""

    def __init__(self, verdict: Identifiability) -> None:
        super().__init__(verdict.summary)
        self.verdict = verdict


@dataclass(frozen=True)
class Motion:
    """Extent of the motion in several logs together: ranges [rad], rms speeds [rad/s], durations [s]."""

    duration: float
    arm_range: float
    pendulum_range: float
    largest_q2: float  # |q2| away from the nearer of upright and hanging
    arm_speed: float
    pendulum_speed: float
    arm_noise: float
    pendulum_noise: float
    command_constant: bool

    @classmethod
    def of(cls, logs: Sequence[Log]) -> Motion:
        ranges = np.array([np.ptp(log.angles, axis=0) for log in logs])
        noise = np.array([log.noise_std for log in logs])
        speeds = []
        for log in logs:
            stride = max(1, round(0.02 / log.sample_time))
            moved = np.diff(log.angles[::stride], axis=0) / np.diff(log.t[::stride])[:, None]
            speeds.append(np.sqrt(np.mean(moved**2, axis=0)) if len(moved) else np.zeros(2))
        best = int(np.argmax(ranges[:, 1]))
        away = [float(np.max(np.abs(np.remainder(log.q2 + np.pi / 2, np.pi) - np.pi / 2))) for log in logs]
        return cls(
            duration=float(sum(log.duration for log in logs)),
            arm_range=float(ranges[:, 0].max()),
            pendulum_range=float(ranges[:, 1].max()),
            largest_q2=max(away),
            arm_speed=float(np.max(speeds, axis=0)[0]),
            pendulum_speed=float(np.max(speeds, axis=0)[1]),
            arm_noise=float(noise[int(np.argmax(ranges[:, 0])), 0]),
            pendulum_noise=float(noise[best, 1]),
            command_constant=all(np.ptp(log.u) == 0 for log in logs),
        )


class Level(StrEnum):
    """How far logs determine the parameters, as tables and plant files have it."""

    GOOD = "good"
    WEAK = "weak"
    LOST = "not identifiable"


@dataclass(frozen=True)
class Identifiability:
    """The verdict.

    unidentified, weak: names of parameters. relative_std: of every estimated parameter, the standard deviation of a
    right model over the reference of `judge` (its size; of friction at least a tenth of the arm's friction at the
    logs' speed, or a hundredth of θ5; of an effect at least a size worth noticing). singular_values: of the
    scaled information, largest first (each is one over the relative standard deviation of a direction).
    weakest: the last direction as {name: component}. advice: sentences, each with what to do.
    """

    level: Level
    unidentified: tuple[str, ...] = ()
    weak: tuple[str, ...] = ()
    relative_std: Mapping[str, float] = None  # type: ignore[assignment]
    singular_values: tuple[float, ...] = ()
    weakest: Mapping[str, float] = None  # type: ignore[assignment]
    advice: tuple[str, ...] = ()

    @property
    def summary(self) -> str:
        head = {
            Level.GOOD: "all parameters are identified",
            Level.WEAK: "some parameters are weak",
            Level.LOST: f"these logs do not show {spoken(self.unidentified)}",
        }[self.level]
        return ": ".join([head, "; ".join(self.advice)] if self.advice else [head])

    def to_dict(self) -> dict[str, object]:
        return {
            "level": self.level.value,
            "not_identified": list(self.unidentified),
            "weak": list(self.weak),
            "relative_std": {k: float(v) for k, v in (self.relative_std or {}).items()},
            "singular_values": [float(s) for s in self.singular_values],
            "weakest_direction": {k: float(v) for k, v in (self.weakest or {}).items()},
            "advice": list(self.advice),
        }


def spoken(names: Iterable[str]) -> str:
    """theta3 as θ3, joined by commas."""
    return ", ".join(name.replace("theta", "θ") for name in names)


def gate(logs: Sequence[Log], known: Iterable[str] = ()) -> Identifiability | None:
    """The verdict of the motion alone, or None if nothing forbids a fit. known: parameters fixed or with a prior."""
    m = Motion.of(logs)
    lost: list[str] = []
    advice: list[str] = []
    arm_still = m.arm_range < max(_SMALLEST, _COUNTS * m.arm_noise)
    pendulum_still = m.pendulum_range < max(_SMALLEST, _COUNTS * m.pendulum_noise)
    degrees = f"q1 covers {m.arm_range:.2g} rad and q2 {m.pendulum_range:.2g} rad"
    if m.duration < _SHORTEST:
        lost += EVERYTHING
        advice.append(
            f"the log is too short: {m.duration:.3g} s of motion; record at least {_SHORTEST:g} s, better 20 s"
        )
    elif arm_still and pendulum_still:
        lost += EVERYTHING
        advice.append(
            f"nothing moves by more than the encoders' resolution ({degrees}); excite the rig, for example with the "
            "paper's d(t), and check the column mapping"
        )
    elif arm_still:
        lost += EVERYTHING
        advice.append(
            f"the arm is held or its encoder is not read ({degrees}): only ratios of the pendulum's own parameters "
            "could be found; let the arm move and drive it"
        )
    elif pendulum_still:
        lost += PENDULUM
        advice.append(
            f"the pendulum is held or its encoder is not read ({degrees}): θ1 includes whatever moves with the arm; "
            f"free the pendulum, or fix {spoken(PENDULUM)}"
        )
    if m.command_constant and "theta1" not in lost:
        lost += EVERYTHING
        cause = (
            "the parameters have no scale" if not set(EVERYTHING) & set(known) else "a fit needs a command that moves"
        )
        advice.append(f"the command is constant throughout: {cause}; drive the arm, or add a driven log")
    lost = [n for n in dict.fromkeys(lost) if n not in set(known)]
    if not lost:
        return None
    return Identifiability(Level.LOST, tuple(lost), advice=tuple(advice))


def judge(
    names: Sequence[str],
    values: NDArray[np.float64],
    information: NDArray[np.float64],
    motion: Motion,
    std: NDArray[np.float64],
    sizes: Mapping[str, float] | None = None,
) -> Identifiability:
    """The verdict of a fit: `information` (n, n) of the values with everything else profiled out; std as reported.

    sizes: of parameters that may well be zero, what would be worth noticing of them. Good where no value is free."""
    if not names:
        return Identifiability(Level.GOOD)
    reference = np.maximum(_references(names, values, motion), [(sizes or {}).get(name, 0.0) for name in names])
    scaled = information * np.outer(reference, reference)
    eigenvalues, vectors = np.linalg.eigh(0.5 * (scaled + scaled.T))
    singular = np.sqrt(np.maximum(eigenvalues[::-1], 0.0))
    direction = vectors[:, 0] * np.sign(vectors[np.argmax(np.abs(vectors[:, 0])), 0])
    relative = dict(zip(names, (std / reference).tolist(), strict=True))
    # the sharpness of tanh is a numerical detail of friction near rest: reported, never a reason for alarm
    judged = {n: s for n, s in relative.items() if not n.startswith("r")}
    lost = tuple(n for n, s in judged.items() if not s < LOST or (_scale_is_lost(judged) and n in _BY_PULL))
    weak = tuple(n for n, s in judged.items() if WEAK < s < LOST and n not in lost)
    weakest = {n: float(c) for n, c in zip(names, direction, strict=True) if abs(c) > 0.25}
    level = Level.LOST if lost else Level.WEAK if weak else Level.GOOD
    advice = tuple(_advice((*lost, *weak), relative, motion))
    return Identifiability(level, lost, weak, relative, tuple(singular.tolist()), weakest, advice)


def _scale_is_lost(relative: Mapping[str, float]) -> bool:
    """Whether the scale that the pendulum's row shares is not identified. Then its frictions are not, either, though at
    their bound, or as a share of what the fit makes of θ5, they may seem to be."""
    own = [n for n in _BY_PULL[:3] if n in relative]
    return len(own) == 3 and not any(relative[n] < LOST for n in own)


def _references(names: Sequence[str], values: NDArray[np.float64], motion: Motion) -> NDArray[np.float64]:
    """What a parameter's uncertainty is measured against: itself; for friction at least a percent of the torques."""
    value = dict(zip(names, np.abs(values).tolist(), strict=True))
    arm = value.get("theta8", 0.0) + value.get("theta6", 0.0) * motion.arm_speed
    pendulum = value.get("theta5", 0.0) * 0.01
    floor = {
        "theta8": 0.1 * arm,
        "theta6": 0.1 * arm / max(motion.arm_speed, 1e-3),
        "theta9": pendulum,
        "theta7": pendulum / max(motion.pendulum_speed, 1e-3),
    }
    return np.array([max(value[n], floor.get(n, 0.0), 1e-12) for n in names])


def _shown(name: str, relative: Mapping[str, float]) -> str:
    shown = f"{spoken([name])} is {'not identified' if not relative[name] < LOST else 'weak'}"
    return shown + (f" (± {100 * relative[name]:.0f} %)" if relative[name] < 10.0 else "")


def _advice(names: Sequence[str], relative: Mapping[str, float], m: Motion) -> Iterable[str]:
    scale = [n for n in _BY_PULL if n in names]
    arm = [n for n in names if n in ("theta1", "theta6", "theta8")]
    for name in names:
        shown = _shown(name, relative)
        if name == "theta2":
            yield (
                f"{shown}: |sin q2| stays below {math.sin(min(m.largest_q2, math.pi / 2)):.2g}; swing the pendulum "
                "further (a hanging log at large amplitude, used jointly), or give its value: --fix theta2=VALUE"
            )
        elif name in arm:
            if name == arm[0]:
                yield (
                    f"{', '.join(_shown(n, relative) for n in arm)}: the arm's rms speed is {m.arm_speed:.2g} rad/s; "
                    f"drive it harder, fast and slow, or give its value: --fix {name}=VALUE"
                )
        elif name in scale and len(scale) < 3:
            yield (
                f"{shown}: the pendulum's rms speed is {m.pendulum_speed:.2g} rad/s; let it swing more, for example "
                f"a free decay while hanging (used jointly with a driven log), or give its value: --fix {name}=VALUE"
            )
        elif name not in scale:
            yield f"{shown}: this experiment hardly shows it; excite it, give a prior, or leave the effect out"
    if len(scale) >= 3:
        yield (
            f"{spoken(scale)} share a scale that only the pendulum's pull on the arm shows, and it is weak here: "
            "drive harder and faster, or weigh and measure the pendulum and give one: --fix theta4=VALUE, or "
            "--fix theta5=VALUE"
        )
