"""One Kalman filter along a log with everything it linearised kept: what smoothing and all later questions need.

`follow` is the extended Kalman filter: it linearises where it believes the state to be. `along` linearises on a given
trajectory instead, usually a smoothed one, and then filters: the answer hardly depends on what the plant gets wrong,
because the trajectory is the rig's. On a kept path everything is linear, so that other noise intensities (`refilter`),
smoothing (`smooth`) or the innovations' answer to any torque are cheap.

With `walk` the state has two more entries, unknown torques w1, w2 on the arm's and the pendulum's row that wander as
random walks: the "forcing function" that the model lacks (Hooker 2009).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import Plant

from .arguments import Assumed, Filtered, Linearised, Model
from .noise_model import RecordNoise
from .path_kernels import follow_log, run_filter, run_smoother
from .record import Record
from .sharpness import sharpness_rows
from .taken import taken

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FilterPath:
    """A linearised log of N samples and a filter's way along it. n: the plant's states, or 2 more with `walk`.

    about (N, n): where it is linearised. carried (N, n): where the model takes about[k−1] at sample k (carried[0] is
    the first state's mean); misread (N, 2): reading minus what the model reads there. transition (N, n, n) and
    push (N, n, 2): how about[k] and a torque held on the two rows from k on change carried[k+1]; reading (N, 2, n).
    filtered (N, n), covariance (N, n, n), gain (N, n, 2): after reading k; e (N, 2) innovations and S (N, 3) their
    covariances (S11, S12, S22). noise: the log's, as the filter took it.
    walk (2,): intensities of w1, w2 [{u}²/s], or None. first (n, n): covariance of the first state.
    used (N, 2): which readings the filter took (see `taken`); the others have e = 0, a gain of 0, and 1 in S.
    """

    record: Record
    plant: Plant
    used: NDArray[np.bool_]
    about: Array
    carried: Array
    misread: Array
    transition: Array
    push: Array
    reading: Array
    first: Array
    noise: RecordNoise
    walk: Array | None
    filtered: Array
    covariance: Array
    gain: Array
    e: Array
    S: Array

    @property
    def states(self) -> int:
        """Number of the plant's own states."""
        return self.plant.packed().rows

    @property
    def read(self) -> NDArray[np.bool_]:
        """(N,) samples of which any reading was taken."""
        return self.used[:, 0] | self.used[:, 1]

    @property
    def inertias(self) -> Array:
        """θ1 … θ4 (4,): what turns torques into accelerations."""
        return self.plant.theta[:4].copy()

    @property
    def linearised(self) -> Linearised:
        """The path's own arrays, as the compiled loops take them."""
        return Linearised(self.about, self.carried, self.misread, self.transition, self.push, self.reading)

    @property
    def assumed(self) -> Assumed:
        return Assumed(self.first, self.noise.packed(), np.zeros(0) if self.walk is None else self.walk)

    @property
    def found(self) -> Filtered:
        """The path's own arrays, as the compiled loops fill them."""
        return Filtered(self.filtered, self.covariance, self.gain, self.e, self.S)


@dataclass(frozen=True)
class Smoothed:
    """Fixed-interval smoothed states (N, n) and their variances (N, n)."""

    mean: Array
    variance: Array


def follow(plant: Plant, record: Record, noise: RecordNoise, walk: Array | None = None) -> FilterPath | None:
    """The extended Kalman filter over a record; None if it loses the log.

    walk (2,): intensities of unknown torques [{u}²/s]; at the start they may be as large as a second's wandering.
    """
    path = _empty(plant, record, noise, walk)
    return path if _filled(path, np.zeros((0, 2))) else None


def along(path: FilterPath, states: Array, velocity_variance: Array) -> FilterPath | None:
    """The same plant, record and noise, linearised on given states (N, n) and filtered.

    velocity_variance (N, 2) [rad²/s²]: how well their velocities are known, which blunts the friction's slope.
    """
    new = _empty(path.plant, path.record, path.noise, path.walk)
    new.about[:] = states
    return new if _filled(new, velocity_variance) else None


def refilter(
    path: FilterPath,
    noise: RecordNoise,
    walk: Array | None = None,
    torque: Array | None = None,
    misreading: Array | None = None,
) -> FilterPath:
    """The filter on the same linearisation with other intensities (`walk` only where the path has one).

    torque (N, 2) [{u}]: a known torque on the rows, held from each sample on; misreading (N, 2) [rad]: a known error
    of the readings. Both become part of the path returned.
    """
    carried, misread = path.carried, path.misread
    if torque is not None or misreading is not None:
        carried, misread = carried.copy(), misread.copy()
        if torque is not None:
            shift = np.einsum("kna,ka->kn", path.push[:-1], torque[:-1])
            carried[1:] += shift
            misread[1:] -= np.einsum("kan,kn->ka", path.reading[1:], shift)
        if misreading is not None:
            misread -= misreading
    first = path.first.copy()
    if walk is not None:
        first[[-2, -1], [-2, -1]] = walk
    found = Filtered(*(np.empty_like(array) for array in path.found))
    new = replace(path, carried=carried, misread=misread, first=first, noise=noise, walk=walk, **found._asdict())
    run_filter(new.record.t, new.used, new.inertias, new.linearised, new.assumed, found)
    return new


def smooth(path: FilterPath) -> Smoothed:
    """Fixed-interval smoothing in the modified Bryson–Frazier form (Bierman 1973), equal to Rauch–Tung–Striebel.

    No covariance is inverted, so that states which are known exactly do no harm.
    """
    mean, variance = np.empty_like(path.filtered), np.empty_like(path.filtered)
    run_smoother(path.linearised, path.found, path.used, mean, variance)
    return Smoothed(mean, variance)


def _empty(plant: Plant, record: Record, noise: RecordNoise, walk: Array | None) -> FilterPath:
    p, codes, rows = plant.packed()
    n, N = rows + (0 if walk is None else 2), len(record.t)
    first = np.zeros((n, n))
    first[:rows, :rows] = record.first_covariance(codes, rows)
    if walk is not None:
        first[[-2, -1], [-2, -1]] = walk
    x0 = record.first_state(p[:, None], codes, rows)
    kept = Linearised(*(np.zeros((N, *shape)) for shape in ((n,), (n,), (2,), (n, n), (n, 2), (2, n))))
    kept.carried[0, :rows] = x0[:, 0]
    found = Filtered(*(np.zeros((N, *shape)) for shape in ((n,), (n, n), (n, 2), (2,), (3,))))
    return FilterPath(
        record=record,
        plant=plant,
        used=taken(record),
        first=first,
        noise=noise,
        walk=None if walk is None else np.array(walk, dtype=float),
        **kept._asdict(),
        **found._asdict(),
    )


def _filled(path: FilterPath, velocity_variance: Array) -> bool:
    """Linearise and filter into the path's own arrays (`about` too where no velocity variances are given)."""
    p, codes, _ = path.plant.packed()
    model = Model(p[:, None], codes, sharpness_rows(path.plant.layout))
    ok = follow_log(
        *(path.record.readings, path.used, model, path.assumed),
        *(np.ascontiguousarray(velocity_variance), path.linearised, path.found),
    )
    return bool(ok) and bool(np.isfinite(path.e).all())
