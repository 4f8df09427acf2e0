"""What the compiled filters are given, by name. The arrays of results are filled in place; everything else is read."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Readings(NamedTuple):
    """What was recorded: t (N,) [s], y (N, 2) readings [rad], u (N, 1) commands held from t on, quantum (2,): one
    count of each encoder [rad], 0 where the reading is not rounded."""

    t: Array
    y: Array
    u: Array
    quantum: Array


class Model(NamedTuple):
    """Plants side by side: P (rows, B) by the plant's layout, codes (effects, 3) of what acts besides model (5), and
    sharp (m, 2): rows of P that hold the sharpness of a friction, with the state its velocity is in."""

    P: Array
    codes: NDArray[np.int64]
    sharp: NDArray[np.int64]


class Gaussian(NamedTuple):
    """Mean, (n,) or (n, B) for B filters, and covariance (n, n) of a state."""

    mean: Array
    covariance: Array


class BankResult(NamedTuple):
    """What a bank of B filters makes of N samples.

    e (N, 2, B), S (N, 3, leaders): innovations and covariances (S11, S12, S22) of the Gaussian readings that filter
    0's rounded ones are equivalent to, as seen by each filter. cost (N, leaders): −log-likelihood of each sample.
    direct (N, 4): of filter 0, readings less predictions, and what rounding adds to the two variances in S.
    states (N, n): filtered state of filter 0, (0, n) where nobody asks for it.
    """

    e: Array
    S: Array
    cost: Array
    direct: Array
    states: Array


class LeaderReadings(NamedTuple):
    """What a pair of readings says to L filters side by side: gains K (2, n, L), the second one for the second
    innovation less what the first said of it; e (2, L) and S (3, L): joint innovations and covariance (S11, S12, S22)
    of the equivalent Gaussian readings; prior (2, L): variances before rounding; cost (L,). seen (n, L) and
    work (4, L) are work space."""

    K: Array
    e: Array
    S: Array
    prior: Array
    cost: Array
    seen: Array
    work: Array

    @classmethod
    def empty(cls, n: int, L: int) -> LeaderReadings:
        """For states of size n and L filters."""
        shapes = ((2, n, L), (2, L), (3, L), (2, L), (L,), (n, L), (4, L))
        return cls(*(np.zeros(shape) for shape in shapes))


class Linearised(NamedTuple):
    """A log linearised along a trajectory, n states: see `FilterPath`."""

    about: Array
    carried: Array
    misread: Array
    transition: Array
    push: Array
    reading: Array


class Assumed(NamedTuple):
    """What a filter on a linearised log assumes: first (n, n) covariance of the first state, noise (4,): torque
    intensities [{u}² s] and variances of the readings [rad²], walk (2,): intensities of unknown torques [{u}²/s], or
    (0,) without any. For L filters side by side noise (4, L) and walk (2 or 0, L)."""

    first: Array
    noise: Array
    walk: Array


class Filtered(NamedTuple):
    """A filter's way along a log of N samples: see `FilterPath`. filtered, covariance and gain may have no rows where
    only innovations are asked for."""

    filtered: Array
    covariance: Array
    gain: Array
    e: Array
    S: Array
