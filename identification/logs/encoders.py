"""What the samples of an angle say about its encoder: the step it moves in, and how noisy it is."""

from __future__ import annotations

import math

import numpy as np
from scipy.signal import savgol_coeffs, savgol_filter

_NOISE_WINDOW = 15  # samples, order 3: within a tenth of the true noise in the tests
_NOISE_SPAN = 0.03  # s; a window longer than this no longer fits the motion itself
FEWEST_STEPS = 8
"""Changes of an angle from which it may be told whether it moves in steps."""
USUAL_COUNTS = (*(1000, 1024, 1440, 2000, 2048, 2400, 2500, 3600, 4000, 4096, 5000), *(8000, 8192, 10000, 16384, 20000))
"""Counts per revolution of encoders that are sold, all four edges counted."""
_DECIMAL = 1e-3  # of log10 of a step, within which it is a digit of the file's numbers
_SAME_COUNTS = 0.004  # of an encoder's step, within which it is that of a usual encoder

_FINEST_STEP = 1e-5  # rad; finer encoders (600 000 counts) look like no encoder at all


def encoder_step(q: np.ndarray) -> float | None:
    """Smallest step of an angle that moves in whole multiples of it [unit of q], or None if it does not.

    None also for an angle that hardly moves (fewer than FEWEST_STEPS changes) and for noise added after the encoder.
    """
    steps = np.abs(np.diff(q))
    steps = steps[steps > _FINEST_STEP]
    if steps.size < FEWEST_STEPS:
        return None
    smallest = float(steps.min())
    counts = np.round(steps / smallest)
    step = float(np.sum(counts * steps) / np.sum(counts**2))  # refined: files round their numbers
    # A whole number of counts within a twentieth each; a continuous signal would be spread evenly over ±1/2.
    # Counts above 20 are not judged, because the step itself is not known better than that.
    judged = steps[counts <= 20] / step
    off = np.abs(judged - np.round(judged))
    return step if judged.size >= 0.5 * steps.size and np.quantile(off, 0.95) < 0.05 else None


def usual_counts(counts: float) -> int | None:
    """The usual encoder that has so many counts per revolution, as a step measures them; None if none has."""
    near = min(USUAL_COUNTS, key=lambda usual: abs(counts / usual - 1))
    return near if abs(counts / near - 1) < _SAME_COUNTS else None


def is_decimal(step: float | None) -> bool:
    """Whether a step is a digit behind the decimal point, so one of the file's numbers and not of an encoder."""
    if not step or step >= 1.0:
        return False
    places = -math.log10(step)
    return abs(places - round(places)) < _DECIMAL


def counted_in_turns(step: float | None) -> int | None:
    """Counts per revolution of the usual encoder that steps [unit of the angle] of this size are of if the angle is in
    turns, and of none if it is in rad; None without one, and where the file's numbers end at such a step."""
    if not step or is_decimal(step) or usual_counts(2.0 * np.pi / step):
        return None
    return usual_counts(1.0 / step)


def moves_by(q: np.ndarray, step: float) -> bool:
    """Whether an angle, however fast, moves by whole multiples of a step [unit of q] that is known."""
    moves = np.abs(np.diff(q))
    with np.errstate(over="ignore", invalid="ignore"):  # of a step that is next to nothing
        moves = moves[moves > 0.5 * step] / step
        off = np.abs(moves - np.round(moves))
    return moves.size >= FEWEST_STEPS and float(np.quantile(off, 0.95)) < 0.05


def shortest_for_noise(T: float) -> int:
    """Samples that `noise_std` needs at sample time T [s]."""
    return 3 * _smoothed_over(T)


def _smoothed_over(T: float) -> int:
    return int(np.clip(round(_NOISE_SPAN / T), 7, _NOISE_WINDOW)) | 1


def noise_std(q: np.ndarray, T: float) -> float:
    """Standard deviation of the measurement noise, quantisation included, without a model.

    Residual of a Savitzky–Golay smoother of order 3 over at most 15 samples (fewer where they would span
    more than 30 ms), scaled for its own degrees of freedom; not below the step/√12 of an encoder that is seen.
    """
    window = _smoothed_over(T)
    if len(q) < shortest_for_noise(T):
        raise ValueError(f"{len(q)} samples: a noise estimate needs at least {shortest_for_noise(T)}")
    residual = (q - savgol_filter(q, window, 3))[window:-window]
    kept = 1.0 - savgol_coeffs(window, 3)[window // 2]  # residual variance of white noise, a projection
    smooth = float(np.sqrt(np.mean(residual**2) / kept))
    step = encoder_step(q)
    return smooth if step is None else max(smooth, step / float(np.sqrt(12)))
