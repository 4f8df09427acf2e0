"""How plain is a hidden effect? The gap that model (5) leaves on the rig's log after its nine parameters are refitted.

Free of noise: the rig runs with exact encoders, then the same mechanics without effects replays windows of that run.
What is left is what a diagnosis has to work with, in units of the encoders' own noise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from .kernels.replay import replay
from .recording import BenchRecord, PendulumLost, record
from .rigs import HiddenEffect, Rig

_MASSES = ("th1", "th2", "th3", "th4", "th5", "fv1", "fv2", "fc1", "fc2")
_STEPS = (1e-6, 1e-6, 1e-5, 1e-5)  # for differences: rad, rad, rad/s, rad/s
_MOST_WINDOWS = 16  # spread over the record
_FURTHEST = 4.0  # of a logarithm: friction that is stiffer still takes minutes to integrate, and no rig has it
_PRIOR = 0.5  # sd of the logarithm of each parameter about the truth: keeps unexcited directions in place


@dataclass(frozen=True)
class EffectSize:
    """gap_q1, gap_q2 [rad]: rms error of free runs over `window` [s], starts and parameters fitted.

    ratio: √(1 + mean (gap/σ)²) with σ the encoders' noise: the held-out gap over its floor. ratio_before: the same
    with the true parameters in place of fitted ones. absorbed: the share of the squared gap that θ takes away.
    """

    gap_q1: float
    gap_q2: float
    ratio: float
    ratio_before: float
    absorbed: float
    window: float


def effect_size(
    rig: Rig, experiment: str = "paper", seed: int = 0, duration: float | None = None, window: float | None = None
) -> EffectSize:
    """Size of what `rig` hides, on one experiment. Raises PendulumLost if the pendulum does not survive it.

    window [s]: length of the free runs; default 2.3 of the rig's fall times (0.4 s for the paper's rig).
    """
    log = record(rig, experiment, seed, duration, noise_free=True)
    window = window or 2.3 * rig.kind.fall_time
    theta = np.zeros(9)
    for fraction in (0.25, 0.5, 1.0):  # short windows first: nearly linear, so no false minimum
        problem = _Windows(log, fraction * window)
        theta, after = problem.fit(theta)
    before = problem.fit_starts()
    gap = problem.sigma * np.sqrt(np.mean(after**2, axis=(0, 1)))
    left, all_of_it = float(np.mean(after**2)), float(np.mean(before**2))
    return EffectSize(
        gap_q1=float(gap[0]),
        gap_q2=float(gap[1]),
        ratio=math.sqrt(1.0 + left),
        ratio_before=math.sqrt(1.0 + all_of_it),
        absorbed=1.0 - left / all_of_it if all_of_it > 0 else 0.0,
        window=window,
    )


def strength_for(
    rig: Rig, name: str, ratio: float, experiment: str = "paper", form: str = "", variation: int = 0, seed: int = 0
) -> float:
    """Strength at which effect `name`, put on `rig`, has an `effect_size(...).ratio` near the one asked for.

    The gap grows about in proportion to the strength; three rounds of that rule, from strength 1. Never above 4.
    Raises ValueError for a ratio of 1 or less, and for effects that the parameters absorb; PendulumLost if the pendulum
    falls at every strength tried.
    """
    if not ratio > 1.0:
        raise ValueError(f"ratio {ratio} given, expected more than 1 (1 is no effect).")
    spec = HiddenEffect(name, form=form, variation=variation)
    if spec.spec.kind in ("absorbed", "control"):
        raise ValueError(f"{name} leaves no gap to choose a strength by: expected a library or an outside effect.")
    strength, best, lost = 1.0, (math.inf, math.nan), {}
    for _ in range(3):
        effects = (*rig.effects, replace(spec, strength=strength))
        try:
            got = effect_size(replace(rig, effects=effects), experiment, seed).ratio
        except PendulumLost as loss:
            lost[strength] = loss
            strength *= 0.5
            continue
        best = min(best, (abs(math.log((got - 1.0) / (ratio - 1.0))), strength))
        strength = min(4.0, strength * math.sqrt((ratio**2 - 1.0) / (got**2 - 1.0)))
        if best[0] < 0.15:
            break
    if math.isnan(best[1]):
        tried = ", ".join(f"{strength:g}" for strength in lost)
        raise PendulumLost(
            f"{name} on {rig.kind.name}, experiment {experiment!r}: the pendulum is lost at the strengths {tried}. "
            "Take a gentler experiment (dither, paper), another rig or another seed.",
            lost[min(lost)].record,
        )
    return best[1]


class _Windows:
    """Residuals over windows, in units of the encoders' noise, and their Gauss–Newton fit."""

    def __init__(self, log: BenchRecord, window: float):
        rig = log.rig
        self._log = log
        self._length = round(window / log.sample_time) + 1
        if len(log.t) < 2 * self._length:
            raise ValueError(f"a record of {log.t[-1]:.2f} s given, expected more than twice the window ({window} s).")
        count = min(_MOST_WINDOWS, len(log.t) // self._length)
        self._first = np.linspace(0, len(log.t) - self._length, count).astype(int)
        index = self._first[:, None] + np.arange(self._length)
        self._seen = np.stack([log.q1[index], log.q2[index]], axis=-1)
        self._x0 = log.state[self._first].copy()
        self._x0[:, 0], self._x0[:, 1] = log.q1[self._first], log.q2[self._first]
        self._fields = rig.without_effects().draft().fields
        self._fields["hard"] = 0
        self._link = tuple(np.zeros(2) for _ in range(5))
        quantum = 2.0 * math.pi / np.array(rig.counts)
        self.sigma = np.sqrt(quantum**2 / 12.0 + rig.encoder_noise**2)

    def _residual(self, x0: np.ndarray, log_theta: np.ndarray) -> np.ndarray:
        fields = self._fields.copy()
        for name, shift in zip(_MASSES, log_theta, strict=True):
            fields[name] *= math.exp(shift)
        run = replay(self._log.t, self._log.u, self._first, x0, self._length, fields, self._link)
        return (self._seen - run) / self.sigma

    def fit(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Fit the starts, then starts and log θ together from `theta` on.

        Returns log θ (9,) relative to the truth, and the residuals (windows, length, 2).
        """
        self._x0, _, _ = self._descend(self._x0, theta, False)
        self._x0, theta, e = self._descend(self._x0, theta, True)
        return theta, e

    def fit_starts(self) -> np.ndarray:
        """Residuals (windows, length, 2) with the true θ and fitted starts."""
        return self._descend(self._x0, np.zeros(9), False)[2]

    def _descend(self, x0: np.ndarray, theta: np.ndarray, with_theta: bool, rounds: int = 40):
        """Levenberg–Marquardt; (x0, log θ, residuals)."""
        damping, slopes = 1e-3, None
        e = self._residual(x0, theta)
        cost = float(np.sum(e**2)) + float(theta @ theta) / _PRIOR**2
        for _ in range(rounds):
            slopes = slopes or self._slopes(x0, theta, e, with_theta)
            dx, dtheta = _solve(*slopes, e.reshape(len(e), -1), theta, damping)
            beyond = np.linalg.norm(theta + dtheta, np.inf) > _FURTHEST
            trial = e if beyond else self._residual(x0 + dx, theta + dtheta)
            total = float(np.sum(trial**2)) + float(np.sum((theta + dtheta) ** 2)) / _PRIOR**2
            total = math.inf if beyond else total
            if total < cost:
                # a small gain ends the fit only if the step was nearly undamped
                done = (cost - total < 2e-3 * cost and damping < 0.05) or total < 1e-6 * e.size
                x0, theta, e, cost, slopes, damping = x0 + dx, theta + dtheta, trial, total, None, 0.1 * damping
                if done:
                    break
            else:
                damping *= 10.0
                if damping > 1e4:
                    break
        return x0, theta, e

    def _slopes(
        self, x0: np.ndarray, theta: np.ndarray, e: np.ndarray, parameters: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        """∂e/∂start (windows, m, 4) and ∂e/∂log θ (windows, m, p), by differences."""

        def slope(step: float, start: np.ndarray, log_theta: np.ndarray) -> np.ndarray:
            return ((self._residual(start, log_theta) - e) / step).reshape(len(e), -1)

        starts = [slope(h, x0 + h * row, theta) for h, row in zip(_STEPS, np.eye(4), strict=True)]
        masses = [slope(1e-4, x0, theta + 1e-4 * row) for row in np.eye(9)] if parameters else []
        empty = np.zeros((len(e), e[0].size, 0))
        return np.stack(starts, axis=-1), np.stack(masses, axis=-1) if masses else empty


def _solve(s: np.ndarray, j: np.ndarray, e: np.ndarray, theta: np.ndarray, damping: float):
    """Damped step (starts, log θ) of the least squares; the starts of each window are eliminated first."""
    gram = np.einsum("wmi,wmj->wij", s, s)
    gram += damping * gram * np.eye(4)
    cross, pull = np.einsum("wmi,wmj->wij", s, j), np.einsum("wmi,wm->wi", s, e)
    own_cross, own_pull = np.linalg.solve(gram, cross), np.linalg.solve(gram, pull[..., None])[..., 0]
    dtheta = np.zeros(9)
    if j.shape[-1]:
        a = np.einsum("wmi,wmj->ij", j, j) * (1.0 + damping * np.eye(9)) + np.eye(9) / _PRIOR**2
        a -= np.einsum("wmi,wmj->ij", cross, own_cross)
        b = np.einsum("wmi,wm->i", j, e) - np.einsum("wmi,wm->i", cross, own_pull) + theta / _PRIOR**2
        dtheta = -np.linalg.solve(a, b)
        own_pull = own_pull + np.einsum("wij,j->wi", own_cross, dtheta)
    return -own_pull, dtheta
