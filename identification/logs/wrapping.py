"""Angles that an encoder or its counter wrapped: a jump of a turn, or of all that a counter can hold."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .checks import LogError, warn
from .gaps import gaps

Array = NDArray[np.float64]

_TURN = 2.0 * np.pi
_BITS = (16, 24, 32)  # of counters; what fewer bits hold is less than a turn of most encoders
_STANDS_OUT = 10.0  # times the largest other step
_PLAIN = 0.3  # rad, a step that no wrong guess leaves by chance


def unwrap(name: str, column: str, t: Array, q: Array, counts: float | None = None) -> Array:
    """Angles [rad] without the jumps of more than half a turn between two samples, with a warning.

    counts: of the encoder a turn, if known: then a counter of 16, 24 or 32 bits that overflowed is seen as one. Across
    gaps of the clock only whole turns are taken off. Raises LogError for a jump that is neither: no pendulum turns by
    that between two samples.
    """
    steps = np.diff(q)
    far = np.abs(steps) > np.pi
    if not far.any():
        return q
    first = int(np.argmax(far))
    usual = float(np.max(np.abs(steps[~far]), initial=0.0))
    period = _period(steps[far & ~gaps(t)], usual, counts)
    unwrapped = np.unwrap(q, period=period)
    left = np.abs(np.diff(unwrapped))
    odd = far & ~gaps(t) & (np.abs(steps) > 1.5 * period) & (left > max(_PLAIN, _STANDS_OUT * usual))
    if odd.any():
        at = int(np.argmax(odd))
        raise LogError(
            f"{name}: {column} jumps from {q[at]:.4g} to {q[at + 1]:.4g} rad, {abs(steps[at]) / _TURN:.4g} turns, at "
            f"t = {t[at + 1]:g} s. Expected angles without jumps, or wrapped by whole turns. If a counter overflowed, "
            "declare --unit counts with --encoder-counts; if it is a false reading, delete that row; if the angles "
            "are in degrees, declare --unit deg."
        )
    what = "encoder" if period == _TURN else f"counter ({period / _TURN:.4g} turns)"
    warn(
        f"{name}: {column} jumps by more than half a turn, {int(far.sum())}× (first from {q[first]:.3g} to "
        f"{q[first + 1]:.3g} rad). Taken as a wrapped {what} and unwrapped. If these are spikes, or the "
        "angles are in another unit (--unit), mend that instead."
    )
    return unwrapped


def _period(jumps: Array, usual: float, counts: float | None) -> float:
    """What a counter holds [rad], where every jump is that; else a turn."""
    near = max(3.0 * usual, 4.0 * _TURN / counts) if counts else 0.0
    for bits in _BITS if counts else ():
        period = _TURN * 2.0**bits / counts  # type: ignore[operator]
        if jumps.size and np.all(np.abs(np.abs(jumps) - period) <= near):
            return period
    return _TURN
