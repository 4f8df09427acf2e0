"""Positions to velocities, as in section 2.2 of the paper.

The position filter is the paper's Table 1: a low-pass FIR of order 30 (31 taps) designed with a Nuttall window,
cut-off w_c = 0.07 as a fraction of the Nyquist frequency, run forwards and backwards (zero phase). The velocity
is the central difference (4). All functions work along axis 0 on shape (n,) or (n, m), and expect samples
that are T apart.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import filtfilt, firwin, freqz

WC = 0.07
"""Cut-off of Table 1, as a fraction of the Nyquist frequency (the paper does not say of what; see `low_pass`)."""

ORDER = 30
"""Order of the FIR filter of Table 1; it has one tap more, an odd count: they are symmetric about one."""


def low_pass(wc: float = WC) -> np.ndarray:
    """Coefficients of f_p(z) of Eq. (3), shape (ORDER + 1,), gain 1 at zero frequency.

    `wc` is a fraction of the Nyquist frequency, as in the tool that the paper used: at T = 1 ms, 0.07 is 35 Hz.
    With so few taps the window alone sets the slope, so the filter falls off slowly; see `cutoff_frequency`.

    Raises ValueError unless 0 < wc < 1.
    """
    if not 0 < wc < 1:
        raise ValueError(f"wc = {wc}: expected a fraction of the Nyquist frequency between 0 and 1, as 0.07")
    return np.asarray(firwin(ORDER + 1, wc, window="nuttall"))


def cutoff_frequency(taps: np.ndarray, T: float) -> float:
    """Frequency [Hz] at which the zero-phase filter (applied twice) lets half of the amplitude through."""
    frequency, response = freqz(taps, worN=4096, fs=1.0 / T)
    below = np.flatnonzero(np.abs(response) ** 2 <= 0.5)
    return float(np.asarray(frequency)[below[0]]) if below.size else 0.5 / T


def zero_phase(q: np.ndarray, taps: np.ndarray) -> np.ndarray:
    """Filtered positions q_f of Eq. (3): forwards and backwards, with odd reflection at both ends.

    The ends are padded by three times the filter's order, as the function that the paper names does.
    Raises ValueError if the record is not longer than that.
    """
    pad = 3 * (len(taps) - 1)
    if len(q) <= pad:
        raise ValueError(f"{len(q)} samples: the zero-phase filter needs more than {pad}. Record longer.")
    return filtfilt(taps, 1.0, q, axis=0, padlen=pad)


def central_difference(q: np.ndarray, T: float) -> np.ndarray:
    """Velocity by Eq. (4), (q[k+1] − q[k−1]) / 2T; at the two ends the one-sided difference of second order."""
    v = np.empty_like(q, dtype=float)
    v[1:-1] = (q[2:] - q[:-2]) / (2 * T)
    v[0] = (-3 * q[0] + 4 * q[1] - q[2]) / (2 * T)
    v[-1] = (3 * q[-1] - 4 * q[-2] + q[-3]) / (2 * T)
    return v
