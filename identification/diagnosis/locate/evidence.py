"""Which family of torques explains what a plant misses, and how strong the evidence is.

Families compete in generalised least squares on the innovations beside free values of θ, at the log's own noise. The
best is then believed or not by its likelihood with the noise estimated anew, with it and without.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...discrepancy.basis import Columns, Family, Signals, parameter_torques
from ...discrepancy.correction import Flexible, combined
from ...discrepancy.dependence import Dependence
from ...discrepancy.prediction_change import prediction_change
from ...discrepancy.response import Normal
from ...estimation.pool import mapped, shared_pool
from ...kalman.likelihood import innovation_cost
from ...kalman.noise import likeliest
from ...kalman.path import FilterPath, refilter
from ...normal_equations import Gained, ScaledGram
from ...validation.gap import HORIZON
from ..policy import DecisionPolicy
from .location import Suspicion

_REFITS = 4
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Look:
    """A stretch of a log: the corrected plant, and the plain one at its own noise along the same motion.

    start [s]: stamp of the log's first sample, from which the signals' time counts."""

    log: int
    start: float
    flexible: Flexible
    plain: FilterPath
    signals: Signals


@dataclass(frozen=True)
class Evidence:
    """How likely a family of torques makes the logs, and how much it changes of what the plant predicts.

    nats: log-likelihood that it adds beside free θ, less its price. change (2,) [rad]: rms over the logs of what it
    changes of q1 and q2 predicted `HORIZON` ahead.
    """

    nats: float
    change: Array


def evidence_of(looks: Sequence[Look], columns: Sequence[list[Family]], chosen: Collection[Dependence]) -> Evidence:
    """Evidence of the families that are chosen: the price is of their directions and of the search for them, the
    noise estimated anew on both sides.

    With the noise held at what the plain model needs, a missing torque passes for torque noise and its evidence
    shrinks tenfold.
    """
    own = [[f for f in group if f.dependence in chosen] for group in columns]
    with_it, without = mapped(shared_pool(), lambda added: _refit(looks, added), (own, [[] for _ in looks]))
    samples = sum(int(look.plain.used.sum()) for look in looks)
    price = 0.5 * with_it.directions * math.log(samples) + sum(f.price for f in own[0])
    return Evidence(without.value - with_it.value - price, with_it.change())


@dataclass(frozen=True)
class _Refitted:
    """V of the logs with θ and families of torques free, the families' directions, and the corrections: the path of
    each log, and the torque and the error of the readings (N, 2) beside its plant."""

    value: float
    directions: int
    corrections: tuple[tuple[FilterPath, Array, Array], ...]

    def change(self) -> Array:
        """As in `Evidence`: logs by their length."""
        if not self.corrections:  # no linearisation has a likelihood
            return np.zeros(2)
        squares = [prediction_change(path, torque, read, HORIZON) for path, torque, read in self.corrections]
        return np.sqrt(np.average(squares, axis=0, weights=[len(torque) for _, torque, _ in self.corrections]))


def _refit(looks: Sequence[Look], added: Sequence[list[Family]]) -> _Refitted:
    best = _Refitted(math.inf, 0, ())
    for paths in ([look.plain for look in looks], [look.flexible.uncorrected for look in looks]):
        value = math.inf
        for _ in range(_REFITS):
            columns = [[parameters_of(look), *group] for look, group in zip(looks, added, strict=True)]
            total = Normal.together(Normal.of(path, group) for path, group in zip(paths, columns, strict=True))
            coefficients = ScaledGram.of(total.gram).solve(total.right, 1e-9).solution
            rank = _gain(_apart(total, 9), np.arange(len(total.right) - 9))[1] if len(total.right) > 9 else 0
            filtered, corrections = [], []
            for path, group in zip(paths, columns, strict=True):
                torque, misreading = combined(group, coefficients)
                corrected = refilter(path, path.noise, torque=torque, misreading=misreading)
                noise, _ = likeliest(corrected)
                filtered.append(refilter(corrected, noise))
                corrections.append((path, torque, misreading))
            before, value = value, sum(innovation_cost(path.e, path.S) for path in filtered)
            paths = [refilter(path, new.noise) for path, new in zip(paths, filtered, strict=True)]
            if value < best.value:
                best = _Refitted(value, rank, tuple(corrections))
            if before - value < 0.5:
                break
    return best


def suspicions_of(looks: Sequence[Look], columns: Sequence[list[Family]], policy: DecisionPolicy) -> list[Suspicion]:
    """Families by what they add, at the log's own noise, beside free values of θ."""
    pairs = list(zip(looks, columns, strict=True))
    total = Normal.together(
        mapped(shared_pool(), lambda p: Normal.of(p[0].flexible.uncorrected, [parameters_of(p[0]), *p[1]]), pairs)
    )
    left = _apart(total, 9)
    whole = max(_gain(left, np.arange(len(left.right)))[0], 1e-12)
    groups: dict[Dependence, list[int]] = {}
    searched: dict[Dependence, float] = {}
    at = 0
    for family in columns[0]:
        of = family.dependence
        groups.setdefault(of, []).extend(range(at, at + family.size))
        searched[of] = searched.get(of, 0.0) + family.price
        at += family.size
    samples = sum(int(look.plain.used.sum()) for look in looks)
    found = []
    for of, which in groups.items():
        gain, rank = _gain(left, np.array(which))
        price = 0.5 * rank * math.log(samples) + searched[of]
        suspicion = Suspicion(of.channel, of.variable, gain, gain - price, gain / whole)
        found.append((rank, suspicion))
    found.sort(key=lambda item: -item[1].net)
    top = found[0][1].net
    equal = [item for item in found if top - item[1].net < max(policy.simpler, policy.simpler_share * top)]
    first = min(equal, key=lambda item: item[0])
    return [first[1], *(item[1] for item in found if item is not first)]


def parameters_of(look: Look) -> Columns:
    return Columns(torque=parameter_torques(look.signals, look.plain.plant))


def _apart(normal: Normal, first: int) -> Normal:
    """The normal equations of the later columns after the first ones (θ) have taken what they can."""
    A, B, C = normal.gram[:first, :first], normal.gram[:first, first:], normal.gram[first:, first:]
    solved = np.linalg.pinv(A, rcond=1e-10, hermitian=True) @ np.column_stack([B, normal.right[:first]])
    gram = C - B.T @ solved[:, :-1]
    # what θ imitates altogether must not come back as rounding
    gone = np.diag(gram) < 1e-8 * np.diag(C)
    gram[gone], gram[:, gone] = 0.0, 0.0
    right = np.where(gone, 0.0, normal.right[first:] - B.T @ solved[:, -1])
    return Normal(gram, right, normal.square)


def _gain(normal: Normal, which: NDArray[np.int64]) -> Gained:
    """Log-likelihood gain [nats] of some columns, and how many directions they really have."""
    return ScaledGram.of(normal.gram[np.ix_(which, which)]).gain(normal.right[which], 1e-6)
