"""Maximum likelihood through the Kalman filter's innovations (the prediction-error method).

Minimises V(z) = ½ Σ (eᵀ S⁻¹ e + ln det S) over θ, r, effect parameters and noise intensities together, for any number
of logs (Kristensen, Madsen & Jørgensen 2004; Ljung 1999, ch. 7). Works on closed-loop data of the unstable plant and
needs no velocities. Fisher scoring with Levenberg–Marquardt damping; derivatives come from a bank of filters.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import Plant
from furuta_gym.plant.dynamics import substep
from furuta_gym.plant.effects.dispatch import read_sensors

from .coordinates import Coordinate, fill
from .filter_bank import innovations
from .logs import Log

_THREADS = ThreadPoolExecutor(max_workers=2)  # the filter releases the interpreter's lock


@dataclass(frozen=True)
class Record:
    """A log as the filter takes it: t from zero, y (N, 2), u (N, 1), reading variances (2,), first state."""

    t: NDArray[np.float64]
    y: NDArray[np.float64]
    u: NDArray[np.float64]
    variance: NDArray[np.float64]
    velocity: NDArray[np.float64]
    velocity_std: float

    @classmethod
    def from_log(cls, log: Log) -> Record:
        y = np.column_stack([log.q1, log.q2])
        t = np.ascontiguousarray(log.t - log.t[0])
        counts = np.asarray(log.encoder_counts or (0.0, 0.0))
        quantum = np.divide(2 * np.pi, counts, out=np.zeros(2), where=counts > 0)
        measured = np.asarray(log.noise_std)
        variance = np.maximum(np.maximum(quantum**2 / 12.0, 0.25 * measured**2), 1e-14)
        m = min(len(t), max(6, int(0.02 / log.sample_time)))
        slope = np.polyfit(t[:m], y[:m], 1 if m < 12 else 2)[-2]
        spread = 3.0 * math.sqrt(12.0 * variance.max() / m) / max(t[m - 1], 1e-6)
        return cls(t, y, np.ascontiguousarray(log.u[:, None]), variance, slope, 0.1 + spread)


@dataclass
class Expansion:
    """V at z, its gradient (n,) and Fisher information (n, n); per-sample scores (N, n) of every record if asked."""

    value: float
    gradient: NDArray[np.float64]
    information: NDArray[np.float64]
    scores: list[NDArray[np.float64]] | None = None


class PredictionError:
    """The objective V over the free `coordinates` of a plant and the noise, on `records`.

    plant: supplies the structure (effects) and the values of everything that is not free.
    noise: (4,) torque intensities on the rows and factors on the readings' variances, where not free.
    """

    def __init__(
        self,
        plant: Plant,
        records: Sequence[Record],
        coordinates: Sequence[Coordinate],
        noise: NDArray[np.float64],
        longest_step: float = 1e-3,
    ) -> None:
        packed = plant.packed()
        self.p, self.codes, self.rows = packed.p, packed.codes, packed.rows
        self.records, self.coordinates, self.noise = list(records), list(coordinates), np.asarray(noise, dtype=float)
        self.longest_step = longest_step
        bounds = np.array([c.z_bounds for c in self.coordinates])
        self.low, self.high = bounds[:, 0], bounds[:, 1]

    def start(self) -> NDArray[np.float64]:
        """The coordinates of the plant and noise given."""
        z = [
            c.to_z(max((self.noise if c.noise else self.p)[c.row], c.low if c.log else -math.inf))
            for c in self.coordinates
        ]
        return np.clip(np.array(z), self.low, self.high)

    def run(self, record: Record, bank: NDArray[np.float64], leaders: int, states: bool = False):
        """Innovations e (N, 2, B) and covariances S (N, 3, leaders) of the coordinate vectors bank (B, n).

        The first `leaders` have gains of their own, the others share those of bank[0]. None if a filter diverged.
        """
        filled = [fill(self.coordinates, z, self.p, self.noise) for z in bank]
        P = np.ascontiguousarray(np.array([f[0] for f in filled]).T)
        noise = np.ascontiguousarray(np.array([f[1] for f in filled]).T)
        noise[2:] *= record.variance[:, None]
        B, N = len(bank), len(record.t)
        if not np.isfinite(P[:11]).all() or np.any(P[0] * P[3] <= P[2] ** 2):
            return None
        x0 = np.zeros((self.rows, B))
        x0[:2] = record.y[0][:, None]
        reading = x0[:2].copy()
        read_sensors(x0, P, self.codes, reading)
        x0[:2] -= reading - x0[:2]
        x0[2:4] = record.velocity[:, None]
        C0 = np.zeros((self.rows, self.rows))
        C0[[0, 1], [0, 1]] = record.variance
        C0[[2, 3], [2, 3]] = record.velocity_std**2
        group = np.where(np.arange(B) < leaders, np.arange(B), 0)
        e, S = np.empty((N, 2, B)), np.empty((N, 3, leaders))
        X = np.empty((N if states else 0, self.rows))
        h_max = substep(min(1e4, max(1.0, P[9:11].max())), self.longest_step)
        ok = innovations(record.t, record.y, record.u, P, self.codes, x0, C0, noise, group, h_max, e, S, X)
        return (e, S, X) if ok and np.isfinite(e).all() else None

    def value(self, z: NDArray[np.float64]) -> float:
        """V(z), prior included; inf where the filter diverges or M is not positive definite."""
        total = self._prior(z)[0]
        for result in _THREADS.map(lambda r: self.run(r, z[None], 1), self.records):
            if result is None:
                return math.inf
            total += _value(result[0][:, :, 0], result[1][:, :, 0])
        return total

    def expand(self, z: NDArray[np.float64], exact: bool = False, scores: bool = False) -> Expansion:
        """V, gradient and Fisher information at z. `exact` lets the gains follow every parameter, not the noise only."""
        n = len(z)
        noisy = [i for i, c in enumerate(self.coordinates) if exact or c.noise]
        plain = [i for i in range(n) if i not in noisy]
        steps = np.array([c.step for c in self.coordinates])
        steps = np.where(z + steps > self.high, -steps, steps)
        order = noisy + plain
        bank = np.repeat(z[None], n + 1, axis=0)
        bank[np.arange(1, n + 1), order] += steps[order]
        value, gradient, information = self._prior(z)
        all_scores: list[NDArray[np.float64]] = []
        jobs = [(record, part) for record in self.records for part in _halves(len(noisy), n, len(self.records))]

        def work(job):
            record, part = job
            rows = np.concatenate([[0], part + 1])
            return self.run(record, bank[rows], 1 + int(np.sum(part < len(noisy))))

        results = list(_THREADS.map(work, jobs))
        if any(r is None for r in results):
            return Expansion(math.inf, gradient, information)
        parts = len(jobs) // len(self.records)
        for i in range(len(self.records)):
            mine = results[i * parts : (i + 1) * parts]
            e0, S0 = mine[0][0][:, :, 0], mine[0][1][:, :, 0]
            de, dS = np.zeros((len(e0), 2, n)), np.zeros((len(e0), 3, n))
            for (_, part), (e, S, _) in zip(jobs[i * parts : (i + 1) * parts], mine, strict=True):
                for j, position in enumerate(part):
                    target = order[position]
                    de[:, :, target] = (e[:, :, j + 1] - e0) / steps[target]
                    if position < len(noisy):
                        dS[:, :, target] = (S[:, :, j + 1] - S0) / steps[target]
            value += _value(e0, S0)
            g, info = _scores(e0, S0, de, dS, noisy)
            gradient = gradient + g.sum(axis=0)
            information = information + info
            all_scores.append(g)
        return Expansion(value, gradient, information, all_scores if scores else None)

    def _prior(self, z: NDArray[np.float64]) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
        value, gradient, information = 0.0, np.zeros(len(z)), np.zeros((len(z), len(z)))
        for i, (c, zi) in enumerate(zip(self.coordinates, z, strict=True)):
            if c.prior is not None:
                mean, std = c.prior
                r, slope = (c.to_value(zi) - mean) / std, c.slope(zi) / std
                value += 0.5 * r * r
                gradient[i] += r * slope
                information[i, i] += slope * slope
        return value, gradient, information


def _halves(leaders: int, n: int, records: int) -> list[NDArray[np.int64]]:
    """Positions of a bank dealt to two threads where one record alone would leave a core idle."""
    if records > 1:
        return [np.arange(n)]
    # a leader costs about four followers
    cost = np.cumsum(np.where(np.arange(n) < leaders, 4.0, 1.0))
    cut = int(np.searchsorted(cost, cost[-1] / 2.0))
    return [np.arange(cut), np.arange(cut, n)]


def _value(e: NDArray[np.float64], S: NDArray[np.float64]) -> float:
    """½ Σ (eᵀ S⁻¹ e + ln det S) of e (N, 2), S (N, 3) = (S11, S12, S22)."""
    det = S[:, 0] * S[:, 2] - S[:, 1] ** 2
    q = (S[:, 2] * e[:, 0] ** 2 - 2.0 * S[:, 1] * e[:, 0] * e[:, 1] + S[:, 0] * e[:, 1] ** 2) / det
    return 0.5 * float(np.sum(q + np.log(det)))


def whiten(e: NDArray[np.float64], S: NDArray[np.float64]) -> NDArray[np.float64]:
    """L⁻¹ e with S = L Lᵀ: white with unit variance if the model is right. e (N, 2) or (N, 2, m)."""
    l11 = np.sqrt(S[:, 0])
    l21 = S[:, 1] / l11
    l22 = np.sqrt(S[:, 2] - l21**2)
    shape = (-1,) + (1,) * (e.ndim - 2)
    w1 = e[:, 0] / l11.reshape(shape)
    return np.stack([w1, (e[:, 1] - l21.reshape(shape) * w1) / l22.reshape(shape)], axis=1)


def _scores(e, S, de, dS, noisy):
    """Per-sample gradient (N, n) of V and the summed Fisher information (n, n)."""
    w, dw = whiten(e, S), whiten(de, S)
    g = np.einsum("ka,kan->kn", w, dw)
    flat = dw.reshape(-1, dw.shape[2])
    information = flat.T @ flat
    if noisy:
        det = S[:, 0] * S[:, 2] - S[:, 1] ** 2
        inverse = np.empty((len(S), 2, 2))
        inverse[:, 0, 0], inverse[:, 1, 1] = S[:, 2] / det, S[:, 0] / det
        inverse[:, 0, 1] = inverse[:, 1, 0] = -S[:, 1] / det
        D = np.empty((len(S), 2, 2, len(noisy)))
        D[:, 0, 0], D[:, 1, 1] = dS[:, 0][:, noisy], dS[:, 2][:, noisy]
        D[:, 0, 1] = D[:, 1, 0] = dS[:, 1][:, noisy]
        relative = np.einsum("kab,kbcn->kacn", inverse, D)  # S⁻¹ dS
        Se = np.einsum("kab,kb->ka", inverse, e)
        trace = np.einsum("kaan->kn", relative)
        g[:, noisy] += 0.5 * (trace - np.einsum("ka,kabn,kb->kn", Se, D, Se))
        information[np.ix_(noisy, noisy)] += 0.5 * np.einsum("kabn,kbam->nm", relative, relative)
    return g, information


@dataclass(frozen=True)
class Optimum:
    """Where a minimisation ended: z, V there, its expansion, iterations, and whether and why it stopped."""

    z: NDArray[np.float64]
    value: float
    expansion: Expansion
    iterations: int
    converged: bool
    message: str


def minimise(
    problem: PredictionError, z: NDArray[np.float64], iterations: int = 40, tolerance: float = 0.01, free=None
) -> Optimum:
    """Levenberg–Marquardt on V from z, within the bounds. `free`: indices that move (default all).

    Stops when the predicted decrease of V (a log-likelihood: absolute, in nats) stays below `tolerance` twice.
    """
    free = np.arange(len(z)) if free is None else np.asarray(free)
    z = np.clip(z, problem.low, problem.high)
    damping, quiet = 1e-3, 0
    expansion = problem.expand(z)
    if not math.isfinite(expansion.value):
        return Optimum(z, math.inf, expansion, 0, False, "the filter diverges at the start values")
    for iteration in range(1, iterations + 1):
        g, H = expansion.gradient, expansion.information
        held = (z <= problem.low) & (g > 0) | (z >= problem.high) & (g < 0)
        move = np.array([i for i in free if not held[i]], dtype=int)
        improved, predicted = False, 0.0
        for _ in range(12):
            A = H[np.ix_(move, move)]
            scale = np.sqrt(np.maximum(np.diag(A), 1e-12))
            scaled = A / np.outer(scale, scale) + damping * np.eye(len(move))
            step = np.zeros_like(z)
            step[move] = -np.linalg.solve(scaled, g[move] / scale) / scale
            step *= min(1.0, 1.0 / max(np.abs(step).max(), 1e-12))  # at most a factor e, or one scale
            trial = np.clip(z + step, problem.low, problem.high)
            moved = trial - z
            predicted = -float(g @ moved + 0.5 * moved @ H @ moved)
            value = problem.value(trial)
            if value < expansion.value:
                improved = True
                break
            if predicted < tolerance:
                break
            damping = max(10.0 * damping, 1e-4)
        if not improved:
            done = predicted < tolerance
            return Optimum(
                z, expansion.value, expansion, iteration, done, "converged" if done else "no further descent"
            )
        gain = expansion.value - value
        damping = damping / 10.0 if gain > 0.5 * predicted else damping * 2.0
        z = trial
        expansion = problem.expand(z)
        quiet = quiet + 1 if gain < tolerance else 0
        if quiet >= 2:
            return Optimum(z, expansion.value, expansion, iteration, True, "converged")
    return Optimum(z, expansion.value, expansion, iterations, False, f"not converged in {iterations} iterations")
