"""What a rig's computer sees: encoder counts of the two angles, and velocities by a causal filtered difference."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from .declared import checked, plain
from .plant.compiled import compiled
from .plant.effects.dispatch import read_sensors
from .plant.plant_file import SensorsEntry

_ROUNDS = 100  # of the search for the angles that a reading stands for
_CLOSE = 1e-13  # rad


VELOCITY_CUTOFF = 100.0
"""Usual corner [rad/s] of the filtered difference that turns readings into velocities."""


@dataclass(frozen=True)
class Sensors:
    """Two encoders.

    encoder_counts: counts per revolution of (q1, q2), one number for both; 0 or None reads the angle exactly.
    noise_std [rad]: standard deviation of white noise before counting (jitter of the edges, vibration).
    offset [rad]: what is read at zero; it is added before counting.
    velocity_cutoff [rad/s]: corner of the filtered difference that turns readings into velocities.
    Raises ValueError for counts, noise or a corner that cannot be.
    """

    encoder_counts: tuple[float, float] | float | None = 4096
    noise_std: tuple[float, float] | float = 0.0
    offset: tuple[float, float] = (0.0, 0.0)
    velocity_cutoff: float = VELOCITY_CUTOFF

    def __post_init__(self) -> None:
        for field in structs.fields(SensorsEntry):
            value = getattr(self, field.name)
            if value is None and field.name != "encoder_counts":
                raise ValueError(f"{field.name} must be given, got None; leave it out for its default")
            checked(value, field.type, field.name)
            value = plain(value)
            if field.name != "velocity_cutoff":
                pair = np.broadcast_to(0.0 if value is None else value, (2,))
                value = (float(pair[0]), float(pair[1]))
            object.__setattr__(self, field.name, value)

    @property
    def resolution(self) -> NDArray[np.float64]:
        """One count [rad] of each encoder (2,), zero where the reading is exact."""
        counts = np.asarray(self.encoder_counts)
        return np.divide(2 * np.pi, counts, out=np.zeros(2), where=counts > 0)

    def to_dict(self) -> dict[str, Any]:
        return {
            "encoder_counts": list(self.encoder_counts),  # type: ignore[arg-type]
            "noise_std": list(self.noise_std),  # type: ignore[arg-type]
            "offset": list(self.offset),
            "velocity_cutoff": self.velocity_cutoff,
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "Sensors":
        known = {f.name for f in fields(cls)}
        if strange := set(data) - known:
            raise ValueError(f"unknown sensor settings {sorted(strange)}; known are {sorted(known)}")
        settings: Any = {k: tuple(v) if isinstance(v, list) else v for k, v in data.items()}
        return cls(**settings)

    @classmethod
    def of_file(cls, stored: Mapping[str, Any] | None, **given: Any) -> "Sensors":
        """What a plant file says of its sensors, whose further entries and nulls are ignored; `given` beats it."""
        known = {f.name for f in fields(cls)}
        told = {name: value for name, value in (stored or {}).items() if name in known and value is not None}
        return cls.from_dict(told | {name: value for name, value in given.items() if value is not None})

    def read(
        self, X: NDArray[np.float64], P: NDArray[np.float64], codes: NDArray[np.int64], rng: np.random.Generator
    ) -> NDArray[np.float64]:
        """Readings (2, L) [rad] of states X (4 + memory, L), the plants' sensor effects (P, codes) included."""
        Y = np.empty((2, X.shape[1]))
        noise = rng.standard_normal(Y.shape) * np.asarray(self.noise_std)[:, None]
        offset = np.empty_like(Y)
        offset[:] = np.asarray(self.offset)[:, None]
        read_encoders(X, P, codes, offset, noise, self.resolution, Y)
        return Y


def angles_read(readings: NDArray[np.float64], P: NDArray[np.float64], codes: NDArray[np.int64]) -> NDArray[np.float64]:
    """Angles (2, L) [rad] at which encoders without offset, noise and rounding read `readings` (2, L).

    P (n, L), codes: the plants as packed, for their sensor effects. Each round gains as many digits as the readings'
    slope is near one."""
    q = readings.copy()
    for _ in range(_ROUNDS):
        read = q.copy()
        if not read_sensors(q, P, codes, read):
            break
        missed = readings - read
        q += missed
        if not np.abs(missed).max() > _CLOSE:
            break
    return q


@compiled
def read_encoders(X, P, codes, offset, noise, resolution, Y):
    """Y (2, L) = counted reading of X's angles: sensor effects, offset and noise (2, L), then rounding."""
    Y[0] = X[0]
    Y[1] = X[1]
    read_sensors(X, P, codes, Y)
    for axis in range(2):
        step = resolution[axis]
        for k in range(X.shape[1]):
            y = Y[axis, k] + offset[axis, k] + noise[axis, k]
            Y[axis, k] = step * np.floor(y / step + 0.5) if step > 0.0 else y


@compiled(forceinline=True)
def difference_gain(cutoff, sample_time):
    """Weight of the newest difference in the causal filtered difference: 1 − exp(−cutoff · T)."""
    return 1.0 - np.exp(-cutoff * sample_time)


class FilteredDifference:
    """Velocity from readings: v ← v + (1 − e^(−ωc T)) (Δy/T − v), the discrete s ωc/(s + ωc).

    cutoff ωc [rad/s]. `update` takes a reading (2,) and the time since the last one, and gives (2,) [rad/s].
    """

    def __init__(self, cutoff: float = VELOCITY_CUTOFF) -> None:
        self.cutoff = cutoff
        self.reset()

    def reset(self) -> None:
        self._last: tuple[float, float] | None = None
        self._v1 = self._v2 = 0.0

    def update(self, y1: float, y2: float, sample_time: float) -> tuple[float, float]:
        if self._last is not None:
            gain = 1.0 - math.exp(-self.cutoff * sample_time)
            self._v1 += gain * ((y1 - self._last[0]) / sample_time - self._v1)
            self._v2 += gain * ((y2 - self._last[1]) / sample_time - self._v2)
        self._last = (y1, y2)
        return self._v1, self._v2
