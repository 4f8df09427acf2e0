"""A log as the Kalman filter takes it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .logs import Log


@dataclass(frozen=True)
class Record:
    """t (N,) from zero [s], y (N, 2) readings [rad], u (N, 1) commands, held from their sample on.

    variance (2,): of a reading [rad²], and weight (N, 2): factors on it (see `dwell_weights`). velocity (2,) and
    velocity_std: of the first state [rad/s].
    """

    t: NDArray[np.float64]
    y: NDArray[np.float64]
    u: NDArray[np.float64]
    variance: NDArray[np.float64]
    weight: NDArray[np.float64]
    velocity: NDArray[np.float64]
    velocity_std: float

    @classmethod
    def from_log(cls, log: Log) -> Record:
        """Variances from the encoder's counts where known, not below a quarter of the noise that the log shows."""
        counts = np.asarray(log.encoder_counts or (0.0, 0.0))
        quantum = np.divide(2 * np.pi, counts, out=np.zeros(2), where=counts > 0)
        measured = np.asarray(log.noise_std)
        variance = np.maximum(np.maximum(quantum**2 / 12.0, 0.25 * measured**2), 1e-14)
        return cls.from_arrays(log.t - log.t[0], log.angles, log.u, variance)

    @classmethod
    def from_arrays(cls, t: ArrayLike, y: ArrayLike, u: ArrayLike, variance: ArrayLike) -> Record:
        """t (N,), y (N, 2), u (N,), reading variances (2,); the first velocity comes from the first readings."""
        t, y, variance = np.array(t, dtype=float), np.array(y, dtype=float), np.array(variance, dtype=float)
        t -= t[0]
        m = min(len(t), max(6, int(np.searchsorted(t, 0.02))))
        slope = np.polyfit(t[:m], y[:m], 1 if m < 12 else 2)[-2]
        spread = 3.0 * math.sqrt(12.0 * variance.max() / m) / max(t[m - 1], 1e-6)
        return cls(t, y, np.array(u, dtype=float).reshape(-1, 1), variance, dwell_weights(y, t), slope, 0.1 + spread)


MODE=dict(m='none')
def dwell_weights(y, t=None):
    w = np.ones_like(y); m=MODE['m']
    if m.startswith('skip'):
        T=float(m[4:]); k=np.floor((t+1e-9)/T); keep=np.concatenate([[True],np.diff(k)>0]); w[~keep]=np.inf; return w
    for a in range(2):
        d = np.diff(y[:, a]); ch = np.flatnonzero(d) + 1
        ed = np.concatenate([[0], ch, [len(y)]])
        n = np.diff(ed)
        dirs = np.sign(d[ch - 1])
        before = np.concatenate([[0], dirs]); after = np.concatenate([dirs, [0]])
        rev = before * after <= 0
        if m == 'none': f = np.ones(len(n))
        elif m == 'sqrt': f=np.sqrt(n)
        elif m.startswith('all'): f = np.maximum(1.0, n/float(m[3:]))
        elif m.startswith('p'): f = n**float(m[1:])
        w[:, a] = np.repeat(f, n)
    return w
