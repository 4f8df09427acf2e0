"""The experiments that the bench can run: where a run starts, what is added to the command, where the arm is sent.

Phases, signs and starts come from the seed; amplitudes follow the rig's `drive`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .sets import ParameterSet

Signal = Callable[[float], float]
Reference = Callable[[float], tuple[float, float]]


@dataclass(frozen=True)
class Plan:
    """One run: start angles q [rad], excitation d(t) in units of the command, reference (angle, speed) of the arm."""

    start: tuple[float, float]
    excitation: Signal
    reference: Reference = lambda t: (0.0, 0.0)


@dataclass(frozen=True)
class Experiment:
    """plan(set, rng, duration) makes a run. `balances`: the loop keeps the pendulum upright; else it is left to hang
    and the excitation is the whole command. duration [s] unless another is asked for."""

    name: str
    says: str
    duration: float
    balances: bool
    plan: Callable[[ParameterSet, np.random.Generator, float], Plan]


def _squares(amplitude: float, rng: np.random.Generator) -> Signal:
    # Eq. (24): periods 2, 0.5 and 0.3333 s, amplitudes 1, 0.5 and 0.25, first half negative
    waves = [(2.0, 1.0), (0.5, 0.5), (0.3333, 0.25)]
    shifts = rng.uniform(0.0, 1.0, 3)

    def d(t: float) -> float:
        return amplitude * sum(
            a if (t / period + shift) % 1.0 > 0.5 else -a for (period, a), shift in zip(waves, shifts, strict=True)
        )

    return d


def _upright(rng: np.random.Generator) -> tuple[float, float]:
    return 0.0, float(rng.uniform(-0.01, 0.01))


def _paper(s, rng, duration):
    return Plan(_upright(rng), _squares(s.drive, rng))


def _wide(s, rng, duration):
    start, small = _upright(rng), _squares(0.3 * s.drive, rng)
    period, sign = rng.uniform(8.0, 11.0), rng.choice([-1.0, 1.0])
    w = 2.0 * math.pi / period

    def reference(t: float) -> tuple[float, float]:
        grown, rate = (t / 3.0, 1.0 / 3.0) if t < 3.0 else (1.0, 0.0)
        sine, cosine = math.sin(w * t), math.cos(w * t)
        return 1.2 * sign * grown * sine, 1.2 * sign * (rate * sine + grown * w * cosine)

    return Plan(start, small, reference)


def _dither(s, rng, duration):
    start = _upright(rng)
    tones = np.array([0.5, 0.9, 1.4, 2.3, 3.1, 4.7, 6.1, 7.9]) * rng.uniform(0.95, 1.05, 8)
    phases = rng.uniform(0.0, 2.0 * math.pi, 8)
    amplitude = 0.45 * s.drive * math.sqrt(2.0 / len(tones))
    return Plan(start, lambda t: float(amplitude * np.sin(2.0 * math.pi * tones * t + phases).sum()))


def _prbs(s, rng, duration):
    start = _upright(rng)
    clock = 0.03
    bits = rng.choice([-1.0, 1.0], int(duration / clock) + 2)
    return Plan(start, lambda t: float(0.9 * s.drive * bits[int(t / clock)]))


def _steps(s, rng, duration):
    start, small = _upright(rng), _squares(0.15 * s.drive, rng)
    hold = 1.6
    places = rng.uniform(0.2, 0.45, int(duration / hold) + 2) * (1.0 - 2.0 * (np.arange(int(duration / hold) + 2) % 2))
    places *= rng.choice([-1.0, 1.0])
    places[0] = 0.0
    return Plan(start, small, lambda t: (float(places[int(t / hold)]), 0.0))


def _hanging_chirp(s, rng, duration):
    low, high = 0.3, 5.0
    growth = math.log(high / low)
    phase = rng.uniform(0.0, 2.0 * math.pi)
    down = bool(rng.integers(2))

    def d(t: float) -> float:
        z = (duration - t if down else t) / duration
        turns = low * duration * math.expm1(growth * z) / growth
        return 1.2 * s.drive * math.sin(2.0 * math.pi * turns + phase)

    return Plan((0.0, math.pi), d)


def _free_decay(s, rng, duration):
    swing = float(rng.uniform(0.9, 1.3) * rng.choice([-1.0, 1.0]))
    kick = float(rng.choice([-1.0, 1.0])) * 1.5 * s.drive

    def d(t: float) -> float:
        return kick if t < 0.1 else -kick if t < 0.2 else 0.0

    return Plan((0.0, math.pi + swing), d)


EXPERIMENTS: dict[str, Experiment] = {
    e.name: e
    for e in (
        Experiment("paper", "balancing, with the paper's three square waves, Eq. (24)", 20.0, True, _paper),
        Experiment("wide", "balancing while the arm is led slowly through ±1.2 rad", 20.0, True, _wide),
        Experiment("dither", "balancing with a small dither: much time near rest", 20.0, True, _dither),
        Experiment("prbs", "balancing with a fast random binary signal", 20.0, True, _prbs),
        Experiment("steps", "balancing while the arm's place jumps", 20.0, True, _steps),
        Experiment("hanging-chirp", "hanging, open loop, a sine of 0.3 to 5 Hz", 20.0, False, _hanging_chirp),
        Experiment(
            "free-decay",
            "let go 0.9 to 1.3 rad from hanging, two opposite kicks, then motor off",
            20.0,
            False,
            _free_decay,
        ),
        Experiment("long", "as `paper`, for two minutes", 120.0, True, _paper),
    )
}


def experiment(which: str) -> Experiment:
    """An experiment by name; ValueError names those there are."""
    if which not in EXPERIMENTS:
        raise ValueError(f"unknown experiment {which!r}. Expected one of: {', '.join(EXPERIMENTS)}.")
    return EXPERIMENTS[which]
