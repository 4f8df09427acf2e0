"""Excitation signals d(t) to add to a controller's command: the paper's (24), and the usual broad-band ones.

A `Signal` is called with a time or an array of times [s] and gives the command in its own unit; signals add with +.
Every signal is a function of time alone, so one signal can be sampled at any rate and gives the same input.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.signal import max_len_seq

_SNAP = 1e-9  # of a period: k·T is never exactly the printed switching time


class Signal(ABC):
    """A command over time. Defined for t ≥ 0."""

    @abstractmethod
    def __call__(self, t: Any) -> Any:
        """Value at time t [s]; the shape of t."""

    def __add__(self, other: Signal) -> Signal:
        return Sum((self, other))


@dataclass(frozen=True)
class Sum(Signal):
    """The sum of several signals."""

    parts: tuple[Signal, ...]

    def __call__(self, t: Any) -> Any:
        return sum(part(t) for part in self.parts)


@dataclass(frozen=True)
class SquareWave(Signal):
    """−amplitude for `low` seconds, then +amplitude to the end of the period; starts `phase` periods in.

    The value at a switching time is the one before it, as in (24): "−1 for 0 ≤ t ≤ 1, 1 for 1 < t ≤ 2". At t = 2
    the paper gives two values (1 by the interval, −1 by the period); the interval is taken.
    """

    amplitude: float
    period: float
    low: float | None = None
    phase: float = 0.0

    def __post_init__(self) -> None:
        low = self.low_time
        if not (self.period > 0 and 0 < low < self.period):
            raise ValueError(f"square wave: period {self.period}, low {low}: expected 0 < low < period")

    @property
    def low_time(self) -> float:
        """Length of the low part [s], by default half of the period."""
        return 0.5 * self.period if self.low is None else self.low

    def __call__(self, t: Any) -> Any:
        cycles = np.asarray(t, dtype=float) / self.period + self.phase
        inside = cycles - (np.ceil(cycles - _SNAP) - 1)  # (0, 1]: a period's end belongs to it
        at_start = (np.abs(cycles - self.phase) < _SNAP) & (abs(self.phase - round(self.phase)) < _SNAP)
        low = (inside <= self.low_time / self.period + _SNAP) | at_start
        return np.where(low, -self.amplitude, self.amplitude)[()]


@dataclass(frozen=True)
class Chirp(Signal):
    """amplitude · cos of a phase whose frequency goes from `start` to `stop` [Hz] over `duration` [s].

    Linear in time, or with `logarithmic` equally long in each octave. It goes on at `stop` afterwards.
    """

    amplitude: float
    start: float
    stop: float
    duration: float
    logarithmic: bool = False

    def __post_init__(self) -> None:
        if self.duration <= 0 or min(self.start, self.stop) < 0:
            raise ValueError(f"chirp: duration {self.duration}, {self.start} to {self.stop} Hz: expected positive")
        if self.logarithmic and (min(self.start, self.stop) == 0 or self.start == self.stop):
            raise ValueError("a logarithmic chirp needs two different frequencies above 0 Hz")

    def __call__(self, t: Any) -> Any:
        t = np.asarray(t, dtype=float)
        sweep = np.minimum(t, self.duration)
        if self.logarithmic:
            rate = np.log(self.stop / self.start) / self.duration
            cycles = self.start * np.expm1(rate * sweep) / rate
        else:
            cycles = self.start * sweep + 0.5 * (self.stop - self.start) / self.duration * sweep**2
        return (self.amplitude * np.cos(2 * np.pi * (cycles + self.stop * (t - sweep))))[()]


@dataclass(frozen=True)
class Prbs(Signal):
    """Pseudo-random binary sequence ±amplitude of maximum length 2^order − 1, each value held for `hold` seconds.

    Its spectrum is flat up to about 0.44/hold Hz. The seed chooses where in the sequence it starts.
    """

    amplitude: float
    hold: float
    order: int = 10
    seed: int = 0

    def __post_init__(self) -> None:
        if self.hold <= 0 or not 2 <= self.order <= 20:
            raise ValueError(f"prbs: hold {self.hold}, order {self.order}: expected hold > 0 and order 2 to 20")

    @cached_property
    def _values(self) -> np.ndarray:
        bits = max_len_seq(self.order)[0]
        start = np.random.default_rng(self.seed).integers(len(bits))
        return self.amplitude * (2.0 * np.roll(bits, -start) - 1.0)

    def __call__(self, t: Any) -> Any:
        k = np.floor(np.asarray(t, dtype=float) / self.hold + _SNAP).astype(int)
        return self._values[k % len(self._values)]


@dataclass(frozen=True)
class Multisine(Signal):
    """A sum of equally strong sines at `frequencies` [Hz] with random phases, scaled to the peak `amplitude`.

    Of `trials` sets of phases drawn from the seed, the one with the lowest crest factor is taken. The peak is
    looked for over one `period` [s] of the sum (default: ten periods of the slowest sine).
    """

    amplitude: float
    frequencies: tuple[float, ...]
    seed: int = 0
    period: float | None = None
    trials: int = 50

    def __post_init__(self) -> None:
        if not self.frequencies or min(self.frequencies) <= 0:
            raise ValueError(f"multisine: frequencies {self.frequencies}: expected at least one, all above 0 Hz")

    @classmethod
    def band(cls, amplitude: float, low: float, high: float, period: float, seed: int = 0) -> Multisine:
        """All multiples of 1/period between low and high [Hz], so that it repeats after `period` seconds."""
        lines = np.arange(np.ceil(low * period - _SNAP), np.floor(high * period + _SNAP) + 1)
        return cls(amplitude, tuple(lines[lines > 0] / period), seed, period)

    @cached_property
    def _design(self) -> tuple[np.ndarray, float]:
        """Phases and the amplitude of each sine."""
        rng = np.random.default_rng(self.seed)
        omega = 2 * np.pi * np.array(self.frequencies)
        times = np.arange(0, self.period or 10 / min(self.frequencies), 1 / (32 * max(self.frequencies)))
        best, best_peak = np.zeros(len(omega)), np.inf
        for _ in range(max(self.trials, 1)):
            phases = rng.uniform(0, 2 * np.pi, len(omega))
            peak = np.max(np.abs(sum(np.sin(w * times + p) for w, p in zip(omega, phases, strict=True))))
            if peak < best_peak:
                best, best_peak = phases, float(peak)
        return best, self.amplitude / best_peak

    def __call__(self, t: Any) -> Any:
        phases, each = self._design
        angles = 2 * np.pi * np.multiply.outer(np.asarray(t, dtype=float), self.frequencies) + phases
        return each * np.sin(angles).sum(axis=-1)


@dataclass(frozen=True)
class Sines(Signal):
    """Σ amplitude · sin(2π frequency t + 2π phase): frequencies in Hz, phases in periods."""

    amplitudes: tuple[float, ...]
    frequencies: tuple[float, ...]
    phases: tuple[float, ...]

    def __post_init__(self) -> None:
        if not len(self.amplitudes) == len(self.frequencies) == len(self.phases) > 0:
            raise ValueError("sines: expected as many amplitudes as frequencies and phases, at least one")

    def __call__(self, t: Any) -> Any:
        cycles = np.multiply.outer(np.asarray(t, dtype=float), self.frequencies) + np.asarray(self.phases)
        return np.sin(2 * np.pi * cycles) @ np.asarray(self.amplitudes)


@dataclass(frozen=True)
class Scaled(Signal):
    """A signal times a factor."""

    signal: Signal
    factor: float

    def __call__(self, t: Any) -> Any:
        return self.factor * self.signal(t)


def paper_signal(phases: Sequence[float] = (0.0, 0.0, 0.0), scale: float = 1.0) -> Signal:
    """d = d1 + d2 + d3 of (24), d3 with its printed times (0.1667 of 0.3333 s).

    phases: fractions of a period by which each starts later in its cycle (0: as printed). scale: of all three.
    """
    p1, p2, p3 = phases
    return Sum(
        (
            SquareWave(1.0 * scale, 2.0, 1.0, p1),
            SquareWave(0.5 * scale, 0.5, 0.25, p2),
            SquareWave(0.25 * scale, 0.3333, 0.1667, p3),
        )
    )


def _random_phases(seed: int) -> tuple[float, ...]:
    return tuple(np.random.default_rng(seed).uniform(size=3)) if seed else (0.0, 0.0, 0.0)


EXCITATIONS: dict[str, Callable[[float, float, int], Signal]] = {
    "paper": lambda scale, duration, seed: paper_signal(_random_phases(seed), scale),
    "square": lambda scale, duration, seed: SquareWave(scale, 2.0),
    "chirp": lambda scale, duration, seed: Chirp(scale, 0.1, 5.0, duration, logarithmic=True),
    "prbs": lambda scale, duration, seed: Prbs(scale, 0.05, 12, seed),
    "multisine": lambda scale, duration, seed: Multisine.band(scale, 0.1, 5.0, min(duration, 10.0), seed),
}
"""Signals by the name used on the command line: (scale, duration [s], seed) → Signal."""


def excitation(name: str, scale: float = 1.0, duration: float = 20.0, seed: int = 0) -> Signal:
    """A ready signal by name. Raises ValueError with the names that exist."""
    if name not in EXCITATIONS:
        raise ValueError(f"excitation {name!r}: expected one of {', '.join(EXCITATIONS)}")
    if not (duration > 0 and np.isfinite(scale)):
        raise ValueError(f"excitation {name}: scale {scale}, duration {duration}: expected finite and positive")
    return EXCITATIONS[name](scale, duration, seed)
