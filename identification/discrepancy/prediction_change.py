"""What a torque beside the model would change of a prediction: the size of what a log leaves unexplained.

Evidence grows with the length of a log, and a long log can prove a torque that nobody would miss. Its size is what it
does to a prediction over the horizon that gaps are measured at.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant.compiled import compiled

from ..kalman.path import FilterPath

Array = NDArray[np.float64]


def prediction_change(path: FilterPath, torque: Array, misreading: Array, horizon: float) -> Array:
    """Mean squares (2,) [rad²] of what a torque (N, 2) [{u}] on the two rows and an error of the readings (N, 2) [rad]
    change of predictions `horizon` seconds ahead, from states that are known.

    Windows start every quarter of the horizon. Zero for a log that is shorter than the horizon.
    """
    n = path.states
    t = path.record.t
    starts = np.searchsorted(t, np.arange(t[0], t[-1] - horizon, 0.25 * horizon))
    ends = np.searchsorted(t, t[starts] + horizon - 0.5 * float(np.median(np.diff(t))))
    kept = (path.transition[:, :n, :n], path.push[:, :n], path.reading[:, :, :n], torque, misreading)
    changes = _changes(*(np.ascontiguousarray(a) for a in kept), starts, np.minimum(ends, len(t) - 1))
    return np.mean(changes**2, axis=0) if len(changes) else np.zeros(2)


@compiled(nogil=True)
def _changes(Phi, push, H, torque, misreading, starts, ends):
    n = Phi.shape[1]
    out = np.zeros((starts.shape[0], 2))
    s, moved = np.zeros(n), np.zeros(n)
    for w in range(starts.shape[0]):
        s[:] = 0.0
        for k in range(starts[w], ends[w]):
            for i in range(n):
                x = push[k, i, 0] * torque[k, 0] + push[k, i, 1] * torque[k, 1]
                for r in range(n):
                    x += Phi[k, i, r] * s[r]
                moved[i] = x
            s[:] = moved
        for a in range(2):
            x = misreading[ends[w], a] - misreading[starts[w], a]
            for i in range(n):
                x += H[ends[w], a, i] * s[i]
            out[w, a] = x
    return out
