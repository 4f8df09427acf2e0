"""The zeros of the encoders in each log: logs of one rig need not count from the same place.

An incremental encoder counts from where it stood when it was switched on. The arm's zero matters as soon as anything on
the rig depends on the arm's angle, as a cable does; the pendulum's is set at rest and may be a count or two off.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import Plant

from ..kalman.coordinates import Zeros, noise_coordinates, placed, zero_coordinates
from ..kalman.noise_model import Noise
from ..kalman.record import stretches
from ..logs.checks import warn
from ..logs.log import Log
from .long_logs import PARTS, part_of
from .optimise import minimise
from .pool import mapped, one_blas_thread, shared_pool
from .prediction_error import PredictionError, quietest

_RESTLESS = 100.0  # times the least torque noise, from which the fit of the zeros starts
_ITERATIONS, _TOLERANCE = 20, 0.05
_PLAIN_COUNTS = 5.0  # a zero that lies further off than so many counts is worth a warning
_AT_BOUND = 1e-9  # of a coordinate
_NO_STEP = 1e-3  # rad, taken for a count where readings have none


@dataclass(frozen=True)
class Aligned:
    """Logs with the zeros of their encoders taken off, and these zeros [rad] by number of the log."""

    logs: tuple[Log, ...]
    zeros: Zeros


def moved(logs: Sequence[Log], zeros: Zeros) -> tuple[Log, ...]:
    """The logs with zeros of their encoders taken off."""
    return tuple(log.moved(*zeros[i]) if i in zeros else log for i, log in enumerate(logs))


@one_blas_thread
def aligned(plant: Plant, logs: Sequence[Log]) -> Aligned:
    """Logs of a plant that was identified on others, with the most likely zeros of their encoders taken off.

    Two numbers a log are estimated, nothing of the plant: the arm's zero, where an effect depends on its angle, and the
    pendulum's within a count or two. A log on which the filter diverges, or without a stretch that it can follow, keeps
    its zeros. Raises LogError where no log has such a stretch.
    """
    found = stretches(logs)

    def zeros_of(i: int) -> tuple[float, float] | None:
        records = [stretch.record for stretch in found if stretch.log == i]
        least = quietest(plant, records)
        coordinates = [*zero_coordinates(plant, records, free=(i,)), *noise_coordinates(least)]
        problem = PredictionError(plant, records, coordinates, Noise(_RESTLESS * least))
        problem = part_of(problem, PARTS[-1]) or problem  # enough for two numbers
        optimum = minimise(problem, problem.start(), _ITERATIONS, _TOLERANCE, exact=False)
        return problem.zeros_at(optimum.z).get(i, (0.0, 0.0)) if np.isfinite(optimum.value) else None

    which = sorted({stretch.log for stretch in found})
    every = zip(which, mapped(shared_pool(), zeros_of, which), strict=True)
    zeros = {i: own for i, own in every if own is not None}
    return Aligned(moved(logs, zeros), zeros)


def warn_about_zeros(plant: Plant, logs: Sequence[Log], zeros: Zeros) -> None:
    """Warn where the arm of a log plainly starts to count from another place than in the first log."""
    if not placed(plant):
        return
    for i, (zero, _) in zeros.items():
        step = _arm_step(logs[i])
        if abs(zero) > _PLAIN_COUNTS * (step or _NO_STEP):
            counted = f" ({zero / step:+.0f} counts)" if step else ""
            warn(
                f"{logs[i].source}: the arm's angle is counted from a zero that lies {zero:+.3g} rad{counted} from the "
                "first log's. That is allowed for. To have one zero, start every recording with the arm at the same "
                "place."
            )


def bounded_zeros(logs: Sequence[Log], problem: PredictionError, z: NDArray[np.float64]) -> list[str]:
    """A sentence for each log whose pendulum's zero ends at its bound, where the fit ends at z."""
    ends = zip(problem.coordinates, z, problem.low, problem.high, strict=True)
    return [
        f"{logs[c.zero_of].source}: the pendulum's zero ends at its bound of {1e3 * c.to_value(at):+.3g} mrad, so the "
        "true one may lie further off. Set it anew with the pendulum at rest, or let `furuta diagnose` look for it "
        "(pendulum_encoder_offset)"
        for c, at, low, high in ends
        if c.zero_of is not None and c.row == 1 and not low + _AT_BOUND < at < high - _AT_BOUND
    ]


def _arm_step(log: Log) -> float | None:
    """One count of the arm's encoder [rad], declared or as the samples show it; None where it has none."""
    counts = log.encoder_counts[0] if log.encoder_counts else 0.0
    return 2 * math.pi / counts if counts > 0 else log.encoder_steps[0]
