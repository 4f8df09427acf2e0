"""What a controller is: readings of the two encoders in, a command out, everything else its own affair."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Reference = float | Callable[[float], float]


class DesignError(ValueError):
    """No controller of this kind exists for this plant; the message says why and what to use instead."""


class Controller(ABC):
    """A sampled controller that sees the encoders only, as `furuta_gym.simulation.Policy` asks for.

    Call it once a sample with the readings y = (q1, q2) [rad], q2 = 0 upright; it gives the command in the plant's
    unit, within ±u_max, to be held for `sample_time` [s]. `reset` forgets the past. With y of shape (2, L) it
    controls L rigs side by side and gives (L,) commands; this is how trials run fast.

    `reference` is the arm angle to hold [rad]: a number, or a function of the time since `reset` [s].
    `tasks` says what it can do: "balance" from near upright, "swing_up" from hanging. `feedback_gain`: K of
    u = −K (q1, q̇1, q2, q̇2) + d where the command is just that, as a log may carry it; else None. `record`: of its
    training, where it was learned, empty if that is not known; else None.
    """

    tasks: tuple[str, ...] = ("balance",)
    feedback_gain: tuple[float, float, float, float] | None = None
    record: Mapping[str, Any] | None = None

    def __init__(self, name: str, sample_time: float, u_max: float, reference: Reference = 0.0) -> None:
        if not (np.isfinite(sample_time) and 0 < sample_time <= 1):
            raise ValueError(f"{name}: sample_time must lie in (0, 1] s, got {sample_time!r}")
        if not (np.isfinite(u_max) and u_max > 0):
            raise ValueError(f"{name}: u_max must be a positive number, got {u_max!r}")
        self.name = name
        self.sample_time = float(sample_time)
        self.u_max = float(u_max)
        self.reference: Reference = reference
        self._samples = 0

    def reset(self) -> None:
        """Start anew: the next reading is the first."""
        self._samples = 0
        self._start()

    def __call__(self, y: ArrayLike) -> Any:
        """Command for the readings y (2,) as a float, or (2, L) as an array (L,). Raises ValueError on other shapes."""
        readings = np.asarray(y, dtype=float)
        if readings.ndim not in (1, 2) or readings.shape[0] != 2:
            raise ValueError(f"{self.name}: expected readings (q1, q2) of shape (2,) or (2, L), got {readings.shape}")
        return self.follow(readings, self.reference_at(self._samples))

    def reference_at(self, sample: int) -> float:
        """The reference [rad] at a sample since `reset`, counted from 0."""
        r = self.reference
        return float(r(sample * self.sample_time) if callable(r) else r)

    def follow(self, y: NDArray[np.float64], reference: float) -> Any:
        """As the call with readings y, with this reference [rad] in place of its own."""
        self._samples += 1
        u = np.minimum(np.maximum(self._command(y, reference), -self.u_max), self.u_max)
        return float(u) if y.ndim == 1 else u

    @abstractmethod
    def _start(self) -> None:
        """Forget the past."""

    @abstractmethod
    def _command(self, y: NDArray[np.float64], reference: float) -> Any:
        """The command, not yet limited, for readings (2,) or (2, L)."""

    def __repr__(self) -> str:
        return f"<{self.name}: T = {self.sample_time:g} s, |u| ≤ {self.u_max:g}>"
