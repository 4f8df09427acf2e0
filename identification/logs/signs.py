"""Does the motion itself agree with the signs of model (5)? A check of zero and sign conventions, in words.

The pendulum's row of (5), divided by θ4, reads

    q̈2 = −(θ3/θ4) q̈1 cos q2 + (θ5/θ4) sin q2 + (θ2/θ4) q̇1² sin q2 cos q2 − (θ7/θ4) q̇2 − …

so whatever the rig, the factor of sin q2 is positive if q2 = 0 is upright, and the factor of q̈1 cos q2 is
negative if the axes are oriented as in the paper. The arm's row gives the command's sign likewise (θ1 > 0).
Only signs are used: the estimates behind them are smoothed and biased, far too rough for anything else.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.signal import savgol_filter

from .gaps import gaps, longest_spacing

_BRIDGED = 0.04  # s without a sample, of which a straight line takes the place: a third of the smoother's span
_MOST_BRIDGED = 0.5  # of the samples
_SPAN = 0.12  # s, of the smoother: long enough for 1000 counts, short against a pendulum's period
_EVEN = 1.5  # of the usual spacing; no sample is later than that where the values stay as they are
_MOST_ROWS = 200_000  # of the regressions: more would make a sign no surer
TRUSTED_R2 = 0.9  # on logs from rigs and simulations the signs were right beyond 0.8 for the pendulum's row
TRUSTED_R2_ARM = 0.5
_TRUSTED_T = 20.0  # the regression's own t ratio is optimistic: its residuals are far from white


@dataclass(frozen=True)
class Signs:
    """Signs that the motion shows: +1 as in the paper, −1 against it, 0 cannot be told from this log."""

    gravity: int
    coupling: int
    command: int

    @property
    def wrong(self) -> str | None:
        """What is wrong in words, None if nothing is known wrong."""
        found: list[str] = []
        coupling = self.coupling
        if self.gravity < 0:
            found.append("the pendulum falls towards q2 = 0, which should be upright")
            coupling = -coupling  # the shift by half a turn turns cos q2 around
        if coupling < 0:
            found.append("with that zero, the arm would push the pendulum to the wrong side (θ3 < 0)")
        elif self.command < 0:
            found.append("a positive command turns the arm towards negative q1")
        return "; ".join(found) or None

    def advice(self, zero: str, flip: Iterable[str]) -> str | None:
        """What is wrong and the options that mend it, given those declared; None if nothing is known wrong."""
        if self.wrong is None:
            return None
        zero, flips = self.mended(zero, flip)
        options = f"--pendulum-zero {zero}" + (f" --flip {','.join(flips)}" if flips else " and no --flip")
        return f"{self.wrong}. Unless you know better, read it with {options}."

    def mended(self, zero: str, flip: Iterable[str]) -> tuple[str, tuple[str, ...]]:
        """The zero and the flips to read with, where these signs were seen with `zero` and `flip`."""
        flips = set(flip)
        coupling = self.coupling
        if self.gravity < 0:
            zero = "upright" if zero == "hanging" else "hanging"
            coupling = -coupling
        if coupling < 0:
            flips ^= {"q1"} if self.command < 0 else {"q2"}
        elif self.command < 0:
            flips ^= {"u"}
        return zero, tuple(sorted(flips))


@dataclass(frozen=True, eq=False)
class Smoothed:
    """An angle between two gaps of the clock, smoothed: q, its first and second derivative v, a, each (n,)."""

    q: np.ndarray
    v: np.ndarray
    a: np.ndarray

    def scaled(self, factor: float, zero: float = 0.0) -> Smoothed:
        """In another unit, then from another zero [of that unit]."""
        return Smoothed(factor * self.q - zero, factor * self.v, factor * self.a)


@dataclass(frozen=True)
class Row:
    """A row of the model fitted to smoothed signals: its first two coefficients, those of their signs that are clear,
    and how much of the output it explains."""

    coefficients: tuple[float, float]
    signs: tuple[int, int]
    r2: float


NO_ROW = Row((0.0, 0.0), (0, 0), 0.0)


def longest_piece(t: np.ndarray) -> tuple[np.ndarray, int]:
    """Indices of the longest stretch between two gaps, and the smoother's window for it; 0 if it is too short.

    A sample that is lost, or some within 40 ms, are no gap here (`evenly`)."""
    steps = np.diff(t)
    T = float(np.median(steps))
    gap = max(2.5 * T, _BRIDGED)
    lost = steps[gaps(t) & (steps <= gap)]
    if np.sum(np.round(lost / T)) > _MOST_BRIDGED * len(t):  # stamps that come in bursts
        gap = longest_spacing(t)
    longest = max(np.split(np.arange(len(t)), np.flatnonzero(steps > gap) + 1), key=len)
    window = int(_SPAN / T) | 1
    return longest, 0 if window < 5 or len(longest) < 4 * window else window


def evenly(t: np.ndarray, values: np.ndarray, T: float) -> np.ndarray:
    """Values of a stretch every T [s], straight lines over lost and late samples; as they are where there are none."""
    if np.max(np.diff(t)) <= _EVEN * T:
        return values
    return np.interp(np.arange(t[0], t[-1] + 0.5 * T, T), t, values)


def smoothed(q: np.ndarray, T: float, window: int) -> Smoothed:
    """An angle of a stretch without gaps, sampled every T [s], by a polynomial over `window` samples."""

    def derivative(order: int) -> np.ndarray:
        return np.asarray(savgol_filter(q, window, 3, deriv=order, delta=T))[_inner(q, window)]

    return Smoothed(np.asarray(q)[_inner(q, window)], derivative(1), derivative(2))


def smoothed_command(u: np.ndarray, window: int) -> np.ndarray:
    """A command of a stretch, smoothed as the angles' derivatives are."""
    return np.asarray(savgol_filter(u, window, 3))[_inner(u, window)]


def _inner(q: np.ndarray, window: int) -> slice:
    return slice(window, -window, -(-len(q) // _MOST_ROWS))


def pendulum_row(arm: Smoothed, pendulum: Smoothed) -> Row:
    """q̈2 by gravity and the arm: coefficients of sin q2 and q̈1 cos q2. Angles in rad."""
    sin, cos = np.sin(pendulum.q), np.cos(pendulum.q)
    return _fit(np.column_stack([sin, arm.a * cos, arm.v**2 * sin * cos, pendulum.v]), pendulum.a)


def arm_row(arm: Smoothed, pendulum: Smoothed, command: np.ndarray) -> Row:
    """The command (smoothed as the angles are) by the arm's motion: coefficients of q̈1 and q̈2 cos q2."""
    v1, v2 = arm.v, pendulum.v
    sin, cos = np.sin(pendulum.q), np.cos(pendulum.q)
    # with a column for a cable: a strong one would else take the sign of the inertia
    columns = [arm.a, pendulum.a * cos, v2**2 * sin, v1, np.tanh(v1 / 0.01), np.ones_like(v1), arm.q]
    return _fit(np.column_stack(columns), command)


def motion_signs(t: np.ndarray, q1: np.ndarray, q2: np.ndarray, u: np.ndarray) -> Signs:
    """Signs of gravity, coupling and command that a log shows between two gaps, each 0 where it is not clear."""
    longest, window = longest_piece(t)
    if not window:
        return Signs(0, 0, 0)
    T = float(np.median(np.diff(t)))
    q1, q2, u = (evenly(t[longest], x[longest], T) for x in (q1, q2, u))
    arm, pendulum = smoothed(q1, T, window), smoothed(q2, T, window)
    row = pendulum_row(arm, pendulum)
    gravity, coupling = row.signs if row.r2 >= TRUSTED_R2 else (0, 0)
    command = arm_row(arm, pendulum, smoothed_command(u, window))
    return Signs(gravity, -coupling, command.signs[0] if command.r2 > TRUSTED_R2_ARM else 0)


def _fit(regressors: np.ndarray, output: np.ndarray) -> Row:
    """Least squares; a sign is clear where the coefficient is many times its error."""
    scale = np.linalg.norm(regressors, axis=0)
    if not np.var(output) > 0 or scale[0] == 0:  # of the smallest numbers the square is zero
        return NO_ROW
    scaled = regressors / np.where(scale > 0, scale, 1.0)
    coefficients, *_ = np.linalg.lstsq(scaled, output, rcond=1e-10)
    residual = output - scaled @ coefficients
    r2 = 1.0 - float(np.var(residual) / np.var(output))
    variance = np.diag(np.linalg.pinv(scaled.T @ scaled, rcond=1e-10)) * np.var(residual)
    std = np.sqrt(
        np.where(variance >= 0, variance, np.inf)
    )  # of columns that depend on each other, rounding may leave less
    clear = np.abs(coefficients) > _TRUSTED_T * std
    signs = np.where(clear, np.sign(coefficients), 0).astype(int)
    values = coefficients / np.where(scale > 0, scale, 1.0)
    return Row((float(values[0]), float(values[1])), (int(signs[0]), int(signs[1])), r2)
