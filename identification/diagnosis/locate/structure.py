"""What structure a smoothed missing torque has: can it be predicted from the motion, has it a frequency?"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...discrepancy.correction import FEWEST_PERIODS, HIGHEST_FREQUENCY

Array = NDArray[np.float64]

_FEATURES, _BLOCKS, _LENGTH, _RIDGE = 150, 10, 2.0, 1.0
_STRIDE = 5  # samples: neighbours say the same
_SEED = 0


def predictable(torque: Array, inputs: Array) -> float:
    """Cross-validated R² of a torque (N,) on random Fourier features of inputs (N, m) (Rahimi & Recht 2007).

    Blocks of time are left out in turn, so that a torque which is merely smooth is not predictable. Below zero: worse
    than its mean.
    """
    y, Z = torque[::_STRIDE], inputs[::_STRIDE]
    Z = (Z - Z.mean(axis=0)) / np.maximum(Z.std(axis=0), 1e-12)
    rng = np.random.default_rng(_SEED)
    W = rng.standard_normal((Z.shape[1], _FEATURES)) / _LENGTH
    F = np.column_stack([np.ones(len(Z)), Z, np.cos(Z @ W + rng.uniform(0, 2 * np.pi, _FEATURES))])
    if np.var(y) < 1e-300:
        return 0.0
    error = np.zeros(len(y))
    for out in np.array_split(np.arange(len(y)), _BLOCKS):
        kept = np.ones(len(y), dtype=bool)
        kept[out] = False
        A, mean = F[kept], y[kept].mean()
        c = np.linalg.solve(A.T @ A + _RIDGE * np.eye(A.shape[1]), A.T @ (y[kept] - mean))
        error[out] = y[out] - mean - F[out] @ c
    return float(1.0 - np.mean(error**2) / np.var(y))


def largest_line(torque: Array, T: float) -> tuple[float, float]:
    """(Fisher's g, frequency [Hz]): largest share of one line in the periodogram of a torque sampled every T [s], of
    lines up to `HIGHEST_FREQUENCY` that have `FEWEST_PERIODS` in it. A slow drift would outweigh them, and does not
    repeat."""
    f = np.fft.rfftfreq(len(torque), T)
    power = np.abs(np.fft.rfft(torque - torque.mean())) ** 2
    inside = (f >= FEWEST_PERIODS / (len(torque) * T)) & (f <= HIGHEST_FREQUENCY)
    total = float(power[inside].sum())
    if total <= 0.0:
        return 0.0, 0.0
    top = int(np.argmax(np.where(inside, power, 0.0)))
    return float(power[top] / total), float(f[top])
