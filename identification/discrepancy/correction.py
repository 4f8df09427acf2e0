"""What a log's noise is, whatever the plant gets wrong: the noise floor without a right model.

A plant that lacks something takes its own errors for torque noise, and a floor computed with that would excuse any
model. Here the plant may be corrected by any combination of `families`: it is linearised along the smoothed motion,
the correction is regressed on the innovations, the noise estimated from what is left, and the motion smoothed anew
under it, until nothing changes. What then passes as torque noise is what no smooth function explains.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import Plant

from ..kalman.likelihood import innovation_cost, whiten
from ..kalman.noise import NoiseFit, fit_noise, likeliest
from ..kalman.path import FilterPath, along, refilter, smooth
from ..kalman.record import Record
from .basis import Columns, Family, Knots, Peaks, Signals, families
from .dependence import Channel
from .response import Normal, Solution, solve

Array = NDArray[np.float64]

FEWEST_PERIODS = 3.0  # within a log: what is slower drifts
HIGHEST_FREQUENCY = 25.0
"""Highest frequency [Hz] at which a periodic torque is looked for; the arm hardly moves above it."""

_BELIEVED = 3.0  # nats of evidence below which nothing is corrected
_CONVERGED = 3.0  # nats
_ROUNDS = 6
_ON_THE_ARM = {Channel.ARM: 1.0, Channel.INPUT: 1.0, Channel.PENDULUM: 0.0}
"""The share of a correction that the arm's row takes, of others a half."""


@dataclass(frozen=True)
class Flexible:
    """A log under a plant with a free correction.

    plain: the plant's own noise fit. path: linearised on the rig's motion and filtered with the correction; its
    `noise` is the log's. evidence [nats]: for any correction at all, at the first look. torque, misreading (N, 2):
    the correction. uncorrected: the same linearisation and noise without it.
    """

    plain: NoiseFit
    path: FilterPath
    uncorrected: FilterPath
    evidence: float
    torque: Array
    misreading: Array
    peaks: Peaks


def flexible(plant: Plant, record: Record) -> Flexible:
    """Correct a plant on a record by whatever the data ask for. Raises ValueError if the filter loses the log."""
    plain = fit_noise(plant, record)
    path, peaks = plain.path, spectral_peaks(plain.path)
    first, value, best = None, np.inf, np.inf
    none = np.zeros((len(record.t), 2))
    found = Flexible(plain, path, path, 0.0, none, none, peaks)
    for _ in range(_ROUNDS):
        smoothed = smooth(path)
        tangent = along(path, smoothed.mean, smoothed.variance[:, 2:4])
        if tangent is None:
            break
        signals = Signals.of(tangent)
        columns = families(signals, plant, Knots.of([signals]), peaks)
        solution = solve(Normal.of(tangent, columns))
        first = solution.evidence if first is None else first
        if solution.evidence < _BELIEVED:
            if found.path is plain.path:
                found = Flexible(plain, tangent, tangent, first, none, none, peaks)
            break
        torque, misreading = combined(columns, solution.coefficients)
        corrected = refilter(tangent, tangent.noise, torque=torque, misreading=misreading)
        noise, _ = likeliest(corrected, _used(columns, solution))
        path = refilter(corrected, noise)
        before, value = value, innovation_cost(path.e, path.S)
        if value < best:
            best = value
            found = Flexible(plain, path, refilter(tangent, noise), first, torque, misreading, peaks)
        if abs(before - value) < _CONVERGED:
            break
    return found


def spectral_peaks(path: FilterPath, most: int = 2) -> Peaks:
    """The largest peaks in the periodogram of the whitened innovations, up to `HIGHEST_FREQUENCY`."""
    w = whiten(path.e, path.S)[path.read]
    f = np.fft.rfftfreq(len(w), float(np.median(np.diff(path.record.t[path.read]))))
    power = np.sum(np.abs(np.fft.rfft(w - w.mean(axis=0), axis=0)) ** 2, axis=1)
    inside = (f >= FEWEST_PERIODS / path.record.duration) & (f <= HIGHEST_FREQUENCY)
    power[~inside] = 0.0
    hertz: list[float] = []
    for _ in range(most):
        if not power.any():  # on a short log there are fewer lines
            break
        hertz.append(float(f[int(np.argmax(power))]))
        power[np.abs(f - hertz[-1]) < 2.5 / path.record.duration] = 0.0
    return Peaks(tuple(hertz), max(1, int(inside.sum())))


def combined(every: Sequence[Columns], coefficients: Array) -> tuple[Array, Array]:
    """Torque and reading error (N, 2) that coefficients of the columns stand for."""
    N = len(every[0].torque if every[0].torque is not None else every[0].misreading)  # type: ignore[arg-type]
    torque, misreading = np.zeros((N, 2)), np.zeros((N, 2))
    at = 0
    for columns in every:
        c = coefficients[at : at + columns.size]
        at += columns.size
        if columns.torque is not None:
            torque += columns.torque @ c
        if columns.misreading is not None:
            misreading += columns.misreading @ c
    return torque, misreading


def _used(columns: list[Family], solution: Solution) -> Array:
    """Degrees of freedom (2,) that the correction took from the torque noise of each row."""
    used, at = np.zeros(2), 0
    for family in columns:
        share = float(solution.leverage[at : at + family.size].sum())
        at += family.size
        arm = _ON_THE_ARM.get(family.channel, 0.5)
        used += share * np.array([arm, 1.0 - arm])
    return used
