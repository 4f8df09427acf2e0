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

from .checks import GAP

_SPAN = 0.12  # s, of the smoother: long enough for 1000 counts, short against a pendulum's period
_MOST_ROWS = 200_000  # of the regressions: more would make a sign no surer
_TRUSTED_R2 = 0.9  # on logs from rigs and simulations the signs were right beyond 0.8 for the pendulum's row
_TRUSTED_R2_ARM = 0.5
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
        flips = set(flip)
        coupling = self.coupling
        if self.gravity < 0:
            zero = "upright" if zero == "hanging" else "hanging"
            coupling = -coupling
        if coupling < 0:
            flips ^= {"q1"} if self.command < 0 else {"q2"}
        elif self.command < 0:
            flips ^= {"u"}
        options = f"--pendulum-zero {zero}" + (f" --flip {','.join(sorted(flips))}" if flips else " and no --flip")
        return f"{self.wrong}. Unless you know better, read it with {options}."


def motion_signs(t: np.ndarray, q1: np.ndarray, q2: np.ndarray, u: np.ndarray) -> Signs:
    """Signs of gravity, coupling and command that a log shows between two gaps, each 0 where it is not clear."""
    T = float(np.median(np.diff(t)))
    longest = max(np.split(np.arange(len(t)), np.flatnonzero(np.diff(t) > GAP * T) + 1), key=len)
    t, q1, q2, u = t[longest], q1[longest], q2[longest], u[longest]
    window = int(_SPAN / T) | 1
    if window < 5 or len(t) < 4 * window:
        return Signs(0, 0, 0)
    inner = slice(window, -window, -(-len(t) // _MOST_ROWS))

    def derivative(q: np.ndarray, order: int) -> np.ndarray:
        return np.asarray(savgol_filter(q, window, 3, deriv=order, delta=T))

    v1, v2, a1, a2 = derivative(q1, 1), derivative(q2, 1), derivative(q1, 2), derivative(q2, 2)
    sin, cos = np.sin(q2), np.cos(q2)
    pendulum = np.column_stack([sin, a1 * cos, v1**2 * sin * cos, v2])
    (gravity, coupling), r2 = _first_two(pendulum[inner], a2[inner])
    if r2 < _TRUSTED_R2:
        gravity = coupling = 0
    # with a column for a cable: a strong one would else take the sign of the inertia
    arm = np.column_stack([a1, a2 * cos, v2**2 * sin, v1, np.tanh(v1 / 0.01), np.ones_like(v1), q1])
    (command, _), r2 = _first_two(arm[inner], derivative(u, 0)[inner])  # u smoothed as the angles are
    return Signs(gravity, -coupling, command if r2 > _TRUSTED_R2_ARM else 0)


def _first_two(regressors: np.ndarray, output: np.ndarray) -> tuple[tuple[int, int], float]:
    """Clear signs of the first two coefficients of a least-squares fit, and its R²."""
    scale = np.linalg.norm(regressors, axis=0)
    if not np.var(output) > 0 or scale[0] == 0:  # of the smallest numbers the square is zero
        return (0, 0), 0.0
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
    return (int(signs[0]), int(signs[1])), r2
