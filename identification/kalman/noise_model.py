"""Noise as a value: torques on the two rows, and the readings either as factors on what a log shows or as variances.

The compiled kernels take four numbers, (torque1, torque2, reading1, reading2); `packed` gives them, and what the last
two mean is said where a kernel is called.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .record import Record

NOISE_NAMES = ("torque_noise1", "torque_noise2", "reading_noise1", "reading_noise2")
"""Of the four packed numbers."""
TORQUE, READING = slice(0, 2), slice(2, 4)
"""Where they stand."""
STRONG = 0.1
"""Of the command's rms: unexplained torque of more is told. `DecisionPolicy.strong` is the same share."""
_WHILE = 0.1  # s, over which torque noise is added up to a torque


@dataclass(frozen=True, eq=False)
class Noise:
    """Noise of a rig, whichever of its logs: what a fit over several logs estimates.

    torque (2,): intensities of white torques on the arm's and the pendulum's row [{u}² s]. reading_factor (2,): what
    a log's own variances of the readings are multiplied by. Raises ValueError for other shapes.
    """

    torque: NDArray[np.float64]
    reading_factor: NDArray[np.float64]

    def __init__(self, torque: ArrayLike, reading_factor: ArrayLike = (1.0, 1.0)) -> None:
        object.__setattr__(self, "torque", _pair("torque", torque))
        object.__setattr__(self, "reading_factor", _pair("reading_factor", reading_factor))

    @classmethod
    def unpacked(cls, numbers: Sequence[float] | NDArray[np.float64]) -> Noise:
        """From the four numbers that `packed` gives."""
        return cls(numbers[TORQUE], numbers[READING])

    def packed(self) -> NDArray[np.float64]:
        """(4,): torque intensities, factors on the readings' variances; a copy."""
        return np.concatenate([self.torque, self.reading_factor])

    def louder(self, factor: float) -> Noise:
        """With `factor` times the torque noise."""
        return Noise(self.torque * factor, self.reading_factor)

    def on(self, record: Record) -> RecordNoise:
        """The noise of one record, rounding included in its readings'."""
        return RecordNoise(self.torque, self.reading_factor * record.variance)


@dataclass(frozen=True, eq=False)
class RecordNoise:
    """Noise of one log.

    torque (2,): intensities of white torques on the arm's and the pendulum's row [{u}² s]. variance (2,): of the
    readings, rounding included [rad²]. Raises ValueError for other shapes.
    """

    torque: NDArray[np.float64]
    variance: NDArray[np.float64]

    def __init__(self, torque: ArrayLike, variance: ArrayLike) -> None:
        object.__setattr__(self, "torque", _pair("torque", torque))
        object.__setattr__(self, "variance", _pair("variance", variance))

    def packed(self) -> NDArray[np.float64]:
        """(4,): torque intensities, variances of the readings; a copy."""
        return np.concatenate([self.torque, self.variance])

    def louder(self, factor: float) -> RecordNoise:
        """With `factor` times the torque noise."""
        return RecordNoise(self.torque * factor, self.variance)


def _pair(name: str, given: ArrayLike) -> NDArray[np.float64]:
    values = np.array(given, dtype=float)
    if values.shape != (2,):
        raise ValueError(f"{name} must be two numbers, for the arm and the pendulum, got shape {values.shape}")
    values.setflags(write=False)
    return values


def unexplained_torque(intensity: float) -> float:
    """Rms torque [{u}] that a torque noise [{u}² s] stands for, over a tenth of a second."""
    return math.sqrt(intensity / _WHILE)
