"""Free runs over short windows with the commands of a record."""

import numpy as np

from .compiled import compiled
from .fields import N_STATES, Q1, Q2
from .stepper import N_WORK, advance


@compiled
def replay(t, u, first, x0, length, params, link):
    """(windows, length, 2) angles of free runs from states x0 (windows, 4) at samples `first`, u (n,) held.

    All NaN if a run leaves all bounds.
    """
    out = np.empty((len(first), length, 2))
    work = np.empty((N_WORK, N_STATES))
    x = np.zeros(N_STATES)
    for w in range(len(first)):
        x[:] = 0.0
        x[:4] = x0[w]
        modes = np.ones(2, np.int64)
        h = 1e-4
        for k in range(length):
            out[w, k, 0], out[w, k, 1] = x[Q1], x[Q2]
            i = first[w] + k
            if k + 1 < length:
                h = advance(t[i], t[i + 1], x, modes, u[i], 0.0, 0.0, params, link, work, h)
                if not abs(x[Q1]) + abs(x[Q2]) < 1e3:
                    out[:] = np.nan
                    return out
    return out
