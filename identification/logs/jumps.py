"""Steps of an angle that no motion makes: readings that stand out, and jumps that stay.

A motion's step from one row to the next lies between those around it, but for what an acceleration adds that comes and
goes within one row. A blow or an end stop changes the speed at once, not the angle, so their steps lie between too.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from .checks import warn
from .encoders import encoder_step
from .gaps import gaps

Array = NDArray[np.float64]

_AROUND = 3  # changes of the angle before and after a step, that it is compared with
_COUNTS = 6.0  # of the encoder
_NOISE = 15.0  # standard deviations of readings that do not move in steps
_SPEEDS = 3.0  # times the speed around it: rows that are lost without a gap in the clock double or treble a step
_FASTEST = 500.0  # rad/s², of what comes and goes within one row
_STANDS_OUT = 5.0  # times the size that one step in a hundred exceeds
_COMES_BACK = 0.3  # of the jump, left where the angle is back
_AT_MOST = 5  # rows of a false reading
_LISTED = 3  # places that a warning names


class Jump(NamedTuple):
    """A step into row `row` by `size` [rad] more than the motion around it, or than the rows before and after.

    back: the row from which the angle goes on as before, None where it stays."""

    row: int
    size: float
    back: int | None


def warn_about_jumps(name: str, t: Array, angles: Mapping[str, tuple[Array, float | None]]) -> None:
    """Warn about readings of angles that stand out, and about jumps that stay.

    t [s]: of the log's own clock. angles: by column, each in rad without the jumps of a wrapped encoder, with its
    counts a turn, None where they are not known.
    """
    found = [(jump, column) for column, (q, counts) in angles.items() for jump in jumps(t, q, counts)]
    found.sort(key=lambda one: one[0].row)
    out = [(jump, jump.back, column) for jump, column in found if jump.back is not None]
    if out:
        places = [
            f"{'one reading' if back == jump.row + 1 else f'{back - jump.row} readings'} of {column} at "
            f"t = {t[jump.row]:.6g} s ({abs(jump.size):.2g} rad from its neighbours)"
            for jump, back, column in out
        ]
        jump, back, _ = out[0]
        cut = f"{(t[jump.row - 1] + t[jump.row]) / 2:.7g}:{(t[back - 1] + t[back]) / 2:.7g}"
        warn(
            f"{name}: {_listed(places)} {'stands' if len(out) == 1 else 'stand'} out, which no motion does. "
            f"Leave each out (--cut {cut}; repeat it for more), or delete these rows."
        )
    stay = [(jump, column) for jump, column in found if jump.back is None]
    if stay:
        places = [f"{column} jumps by {abs(jump.size):.2g} rad at t = {t[jump.row]:.6g} s" for jump, column in stay]
        row = stay[0][0].row
        warn(
            f"{name}: {_listed(places)} and the angle stays there: lost counts, a slipped coupling, or rows that are "
            "missing. From there on the angle counts from another zero. Leave out what follows "
            f"(--cut {t[row]:.7g}:{t[-1]:.7g}), or cut the file in two there and mend the zero of the second part."
        )


def _listed(places: list[str]) -> str:
    *first, last = places[:_LISTED]
    if len(places) > _LISTED:
        last = f"{last}, and {len(places) - _LISTED} more places,"
        return ", ".join([*first, last])
    return f"{', '.join(first)} and {last}" if first else last


def jumps(t: Array, q: Array, counts: float | None = None) -> list[Jump]:
    """The steps of an angle q [rad] at stamps t [s] that no motion makes, in their order. Whole turns are none.

    counts: of the encoder a turn, if known. Steps over gaps of the clock are not judged.
    """
    q = np.unwrap(q)
    steps, spacings = np.diff(q), np.diff(t)
    rows = np.flatnonzero(steps)
    if len(rows) < 2 * _AROUND:
        return []
    since = np.diff(t[rows + 1], prepend=t[0])  # the last change: readings may be held
    beyond, speed = _beyond(steps[rows] / since)
    count = 2.0 * np.pi / counts if counts else encoder_step(q)
    finest = _COUNTS * count if count else _NOISE * _noise(q)
    most = np.maximum(finest, _FASTEST * spacings[rows] ** 2)
    most = np.maximum(most, _SPEEDS * speed * since)
    sizes = beyond * since
    most = np.maximum(most, _STANDS_OUT * np.quantile(np.abs(sizes), 0.99))
    far = (np.abs(sizes) > most) & ~gaps(t)[rows]
    far[-1] = False  # nothing is known of what follows
    return [jump._replace(size=_size(q, jump)) for jump in _paired(rows[far] + 1, sizes[far])]


def _size(q: Array, jump: Jump) -> float:
    """By how much a reading stands out of its neighbours, or a step of those around it [rad]."""
    row, _, back = jump
    if back is not None:
        return float(q[row] - (q[row - 1] + q[back]) / 2.0)
    around = np.delete(np.diff(q[max(row - 1 - _AROUND, 0) : row + 1 + _AROUND]), min(row - 1, _AROUND))
    return float(q[row] - q[row - 1] - np.median(around))


def _beyond(v: Array) -> tuple[Array, Array]:
    """Of each speed, by how much it lies out of the range of those around it and of zero, and how fast it is there: on
    the slower side of the two, as a false reading goes back at once."""
    padded = np.concatenate([np.zeros(_AROUND), v, np.zeros(_AROUND)])
    windows = sliding_window_view(padded, _AROUND)
    before, after = windows[: len(v)], windows[_AROUND + 1 :]
    high = np.maximum(np.maximum(before.max(axis=1), after.max(axis=1)), 0.0)
    low = np.minimum(np.minimum(before.min(axis=1), after.min(axis=1)), 0.0)
    speed = np.minimum(np.abs(before).max(axis=1), np.abs(after).max(axis=1))
    return np.maximum(v - high, 0.0) + np.minimum(v - low, 0.0), speed


def _noise(q: Array) -> float:
    """Standard deviation of white noise in readings [rad], from their second differences."""
    second = np.diff(q, 2)
    return 1.4826 * float(np.median(np.abs(second - np.median(second)))) / float(np.sqrt(6.0))


def _paired(rows: NDArray[np.intp], sizes: Array) -> list[Jump]:
    """Steps out and back again, within a few rows, as one."""
    found: list[Jump] = []
    for row, size in zip(rows.tolist(), sizes.tolist(), strict=True):
        last = found[-1] if found else None
        near = last if last and last.back is None and row - last.row <= _AT_MOST else None
        if near and abs(near.size + size) < _COMES_BACK * abs(near.size):
            found[-1] = near._replace(back=row)
        else:
            found.append(Jump(row, size, None))
    return found
