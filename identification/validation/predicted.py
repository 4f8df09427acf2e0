"""A stretch of a log, predicted again and again: errors, their floor and the innovations, in bounded memory.

The filter keeps some kilobytes a sample. A long stretch is therefore predicted in parts, each with a noise of its own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import Plant

from ..kalman.likelihood import sample_costs
from ..kalman.noise import LostLog
from ..kalman.record import Record, Stretch
from ..kalman.whiteness import Whitened
from .free_run import Windows, free_run
from .noise_floor import noise_floor

_ROOM = 4.0  # longest horizons, that a part has for windows to start in
_ONE_COUNT = 1.5  # counts, between one and two
SETTLE = 0.5  # s that the filter gets before the first prediction
LONGEST = 30_000
"""Samples that are predicted at once: half a minute at 1 kHz, and half a gigabyte."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Predicted:
    """errors (M, J, 2) [rad] of M windows at J horizons, and their variance if the plant were right: floor (M, J, 2)
    [rad²], of which readings_floor comes from the readings alone. readings (M, 2) [rad] and times (M,) [s] at the last
    horizon, by the log's own clock. surprise (K, 3): log, time [s] and −ln likelihood [nats] of every reading one step
    ahead. still (M, 2): whether the readings change by at most one count within a window. log: the stretch's log."""

    log: int
    errors: Array
    floor: Array
    readings_floor: Array
    readings: Array
    times: Array
    surprise: Array
    still: NDArray[np.bool_]
    whitened: Whitened


def predicted(plant: Plant, stretch: Stretch, horizons: tuple[float, ...], longest: int = LONGEST) -> Predicted:
    """The predictions of a plant along a stretch, over horizons [s], at most `longest` samples at once if
    that is long against the horizons.

    Raises LostLog where the filter loses the log or a free run leaves all bounds, ValueError where it is too short.
    """
    shared = SETTLE + max(horizons)  # so that windows follow on those of the part before
    longest = max(longest, math.ceil((shared + _ROOM * max(horizons)) / stretch.piece.sample_time))
    parts: list[Predicted] = []
    for i, part in enumerate(stretch.parts(longest, shared)):
        try:
            parts.append(_predicted(plant, part, horizons, shared if i else 0.0))
        except ValueError as error:
            kind = LostLog if isinstance(error, LostLog) else ValueError
            raise kind(f"{stretch.piece.source}: {error}") from error
    return _joined(parts)


def _predicted(plant: Plant, part: Stretch, horizons: tuple[float, ...], known: float) -> Predicted:
    """known [s]: how much of its beginning belongs to the part before."""
    piece, record = part.piece, part.record
    windows = Windows.over(record.t, horizons, SETTLE)
    floor = noise_floor(plant, record, windows)
    path = floor.path
    errors = free_run(path, windows)
    if not np.isfinite(errors).all():
        raise LostLog(f"the plant's free run over {max(horizons):g} s leaves all bounds")
    at = windows.targets[:, -1]
    since = record.t[0] + known - 1e-9
    used = path.read & (record.t >= since)
    costs = sample_costs(path.e, path.S)
    surprise = np.column_stack([np.full(len(costs), part.log), piece.t, costs])[used]
    return Predicted(
        log=part.log,
        errors=errors,
        floor=floor.variance,
        readings_floor=floor.readings_only,
        readings=record.y[at],
        times=piece.t[at],
        surprise=surprise,
        still=_still(record, windows),
        whitened=Whitened.of(path, since),
    )


def _still(record: Record, windows: Windows) -> NDArray[np.bool_]:
    """Of every window and angle, whether its rounded readings show no motion: a change of one count may be a crossing
    of an edge."""
    ends = zip(windows.starts, windows.targets[:, -1], strict=True)
    changes = np.array([np.ptp(record.y[first : last + 1], axis=0) for first, last in ends])
    return changes < _ONE_COUNT * record.quantum


def _joined(parts: Sequence[Predicted]) -> Predicted:
    if len(parts) == 1:
        return parts[0]
    names = ("errors", "floor", "readings_floor", "readings", "times", "surprise", "still")
    return Predicted(
        log=parts[0].log,
        whitened=Whitened.joined([part.whitened for part in parts]),
        **{name: np.concatenate([getattr(part, name) for part in parts]) for name in names},
    )
