"""The filtered regression model of the paper's section 2.3: signals in, Eq. (21) out.

Filtering (14) by f(s) = λ/(s + λ) turns the unmeasured acceleration into known signals (errata: Eq. (16) prints
s f(s) before Ω_b, (19) has it right):

    [s f(s) Ω_a + f(s) Ω_b] θ = f(s) u,   in short   Ω_f θ = u_f                                    (18)–(21)

In discrete form, exact for what is known of each signal between its samples, and never shifted in time:

- the command is held by the converter, so f(s) u takes the zero-order hold: y⁺ = a y + (1 − a) u, a = e^(−λT);
- Ω_a and Ω_b are samples of continuous signals, so f(s) takes the first-order hold (a straight line between
  two samples, error O(T²)); a zero-order hold there would shift them against the command by half a sample;
- s f(s) Ω_a = λ (Ω_a − f(s) Ω_a), with the filter started at Ω_a(0), so that (21) holds from the first sample
  and no transient has to be cut off.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from furuta_gym.plant.parameters import FRICTION_SHARPNESS
from furuta_gym.plant.regressor import omega_a, omega_b

from ..logs.log import Log, LogError, as_logs
from .signals import ORDER, WC, central_difference, cutoff_frequency, low_pass, zero_phase

LAMBDA = 10.0
"""Default bandwidth λ [1/s] of f(s): where the paper's closed loop moves (its fastest poles are at 12 rad/s).

The noise in s f(s) Ω_a grows in proportion to λ, and the bias of θ3 … θ5 with it; a much smaller λ gives slow torques
that the model lacks (a cable, an offset) more weight than the motion.
"""

_HELD = 10.0  # noise standard deviations, peak to peak: three counts of an encoder


@dataclass(frozen=True)
class FilteredModel:
    """Eq. (21) at the samples of one unbroken recording: u_f (n, 2) = Ω_f (n, 2, 9) θ, at times t (n,)."""

    t: np.ndarray
    omega_f: np.ndarray
    u_f: np.ndarray
    lam: float
    r: float
    wc: float
    velocity_lost: float = 0.0
    """Share of the velocity (rms, the worse axis) that the position filter takes away with the noise, estimated."""
    held: tuple[bool, bool] = (False, False)
    """Whether arm and pendulum stayed within their noise: then their row lacks the torque that held them."""

    @property
    def T(self) -> float:
        """Sample time [s]."""
        return float(self.t[-1] - self.t[0]) / (len(self.t) - 1)


def filter_regressors(
    q: np.ndarray, v: np.ndarray, u: np.ndarray, T: float, *, lam: float = LAMBDA, r: float = FRICTION_SHARPNESS
) -> tuple[np.ndarray, np.ndarray]:
    """Ω_f (n, 2, 9) and u_f (n, 2) of Eqs. (18)–(21) from q, v (n, 2) [rad, rad/s] and the held command u (n,)."""
    a = np.exp(-lam * T)
    held = lfilter([0.0, 1.0 - a], [1.0, -a], u)
    u_f = np.column_stack([held, np.zeros_like(held)])
    w_a = omega_a(q, v)
    w_bf = _first_order_hold(omega_b(q, v, r), lam, T, np.zeros((2, 9)))
    w_af = lam * (w_a - _first_order_hold(w_a, lam, T, w_a[0]))
    return w_af + w_bf, u_f


def _first_order_hold(w: np.ndarray, lam: float, T: float, start: np.ndarray) -> np.ndarray:
    """f(s) w along axis 0 for w linear between samples, output `start` at the first one."""
    a = np.exp(-lam * T)
    new = 1.0 - (1.0 - a) / (lam * T)  # weight of w[k+1] in y[k+1]
    old = (1.0 - a) / (lam * T) - a  # weight of w[k]
    state = start - new * w[0]
    return lfilter([new, old], [1.0, -a], w, axis=0, zi=state[None])[0]


def filtered_models(
    logs: Log | Iterable[Log],
    *,
    lam: float = LAMBDA,
    r: float = FRICTION_SHARPNESS,
    wc: float = WC,
    T: float | None = None,
) -> tuple[FilteredModel, ...]:
    """The filtered model of each unbroken piece of each log, by sections 2.2 and 2.3.

    lam [1/s], r [s/rad], wc [of Nyquist]: as in the paper. T [s]: resample to this; by default the log's own
    sample time (on an even grid if its clock is not even). Pieces too short for the position filter are left out.
    Raises LogError if none is long enough, ValueError for settings that make no sense.
    """
    for name, value in (("lam", lam), ("r", r)):
        if not (np.isfinite(value) and value > 0):
            raise ValueError(f"{name} = {value}: expected a positive number")
    taps = low_pass(wc)
    logs = as_logs(logs)
    models = []
    for log in logs:
        for piece in log.pieces():
            even = piece if T is None and piece.regular else piece.resampled(T)
            if len(even) <= 3 * ORDER:
                continue
            step = even.duration / (len(even) - 1)
            q = zero_phase(even.angles, taps)
            v = central_difference(q, step)
            omega_f, u_f = filter_regressors(q, v, even.u, step, lam=lam, r=r)
            noise = piece.noise_std
            lost = _velocity_lost(even.angles - q, v, noise, 2 * np.pi * cutoff_frequency(taps, step))
            still = np.ptp(even.angles, axis=0) <= _HELD * np.array(noise)
            models.append(FilteredModel(even.t, omega_f, u_f, lam, r, wc, lost, (bool(still[0]), bool(still[1]))))
    if not models:
        names = ", ".join(log.source for log in logs) or "none given"
        raise LogError(f"{names}: no unbroken piece of more than {3 * ORDER} samples, which the filter needs.")
    return tuple(models)


def _velocity_lost(removed: np.ndarray, v: np.ndarray, noise: tuple[float, float], omega_c: float) -> float:
    """What the filter removed beyond the noise moved at its cut-off or faster, so its speed was ω_c times it."""
    motion = np.sqrt(np.maximum(np.mean(removed**2, axis=0) - np.square(noise), 0.0))
    speed = np.sqrt(np.mean(v**2, axis=0))
    return float(np.max(omega_c * motion / np.maximum(speed, 1e-12)))


@dataclass(frozen=True)
class ParameterHistory:
    """θ̂ over time, as in the paper's Fig. 2: t (m,) [s], theta (m, 9); NaN where θ is not determined yet.

    Several recordings follow one another in time, so t starts at 0 and goes on from one to the next.
    """

    t: np.ndarray
    theta: np.ndarray

    @property
    def last(self) -> np.ndarray:
        """The final estimate, shape (9,)."""
        return self.theta[-1]


def joined_times(models: Sequence[FilteredModel]) -> np.ndarray:
    """Times of the samples of several models, one recording after the other, from 0 [s]."""
    times, start = [], 0.0
    for model in models:
        times.append(model.t - model.t[0] + start)
        start = float(times[-1][-1]) + model.T
    return np.concatenate(times)


def stacked(models: Sequence[FilteredModel]) -> tuple[np.ndarray, np.ndarray]:
    """All rows of (21): Y (2n, 9) and u (2n,), rows of the arm and the pendulum in turn."""
    Y = np.concatenate([model.omega_f.reshape(-1, 9) for model in models])
    return Y, np.concatenate([model.u_f.ravel() for model in models])
