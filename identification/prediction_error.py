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
from numpy.typing import ArrayLike, NDArray

from furuta_gym.plant import Plant
from furuta_gym.plant.compiled import compiled
from furuta_gym.plant.effects.dispatch import read_sensors
from furuta_gym.plant.effects.library import NUMBERS

from .coordinates import Coordinate, fill
from .filter_bank import innovations
from .logs import Log

_POLISH = 1.0  # nats: gain below which frozen gains give way to exact derivatives
_STIFF = 1e-4  # relative tolerance of the rigid-body limits
_THREADS = ThreadPoolExecutor(max_workers=2)  # the filter releases the interpreter's lock


@dataclass(frozen=True)
class Record:
    """A log as the filter takes it: t from zero, y (N, 2), u (N, 1), reading variances (2,), first state."""

    t: NDArray[np.float64]
    y: NDArray[np.float64]
    u: NDArray[np.float64]
    variance: NDArray[np.float64]
    weight: NDArray[np.float64]
    velocity: NDArray[np.float64]
    velocity_std: float

    @classmethod
    def from_log(cls, log: Log) -> Record:
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
        return cls(t, y, np.array(u, dtype=float).reshape(-1, 1), variance, dwell_weights(y), slope, 0.1 + spread)


MODE=dict(m='none')
def dwell_weights(y):
    w = np.ones_like(y)
    for a in range(2):
        d = np.diff(y[:, a]); ch = np.flatnonzero(d) + 1
        ed = np.concatenate([[0], ch, [len(y)]])
        n = np.diff(ed)
        dirs = np.sign(d[ch - 1])
        before = np.concatenate([[0], dirs]); after = np.concatenate([dirs, [0]])
        rev = before * after <= 0
        if MODE['m'] == 'none': f = np.ones(len(n))
        elif MODE['m'] == 'rev': f = np.where(rev, n, 1.0)
        elif MODE['m'] == 'rev2': f = np.where(rev, 2.0*n, 1.0)
        elif MODE['m'] == 'revhalf': f = np.where(rev, np.maximum(1,n/2), 1.0)
        elif MODE['m'] == 'all': f = np.maximum(1.0, n.astype(float))
        elif MODE['m'] == 'all4': f = np.maximum(1.0, n/4.)
        elif MODE['m'] == 'all2': f = np.maximum(1.0, n/2.)
        elif MODE['m'] == 'all8': f = np.maximum(1.0, n/8.)
        elif MODE['m'] == 'sqrt': f = np.sqrt(n)
        elif MODE['m'] == 'mix': f = np.where(rev, n, np.maximum(1.0, n/8.))
        w[:, a] = np.repeat(f, n)
    return w


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
    longest_step [s]: of the integration. parallel: use two threads. physical: penalise what no rigid body has.
    """

    def __init__(
        self,
        plant: Plant,
        records: Sequence[Record],
        coordinates: Sequence[Coordinate],
        noise: NDArray[np.float64],
        longest_step: float = 1e-3,
        parallel: bool = True,
        physical: bool = False,
    ) -> None:
        packed = plant.packed()
        self.p, self.codes, self.rows = packed.p, packed.codes, packed.rows
        self.records, self.coordinates, self.noise = list(records), list(coordinates), np.asarray(noise, dtype=float)
        self.longest_step = longest_step
        self.sharp = _sharpness_rows(self.codes)
        self.physical = physical
        self._map = _THREADS.map if parallel else map
        bounds = np.array([c.z_bounds for c in self.coordinates])
        self.low, self.high = bounds[:, 0], bounds[:, 1]
        self.noisy = np.array([c.noise for c in self.coordinates])

    def start(self) -> NDArray[np.float64]:
        """The coordinates of the plant and noise given."""
        z = [c.to_z((self.noise if c.noise else self.p)[c.row]) for c in self.coordinates]
        return np.clip(np.array(z), self.low, self.high)

    def run(
        self, record: Record, bank: NDArray[np.float64], leaders: int, states: bool = False, exact: int | None = None
    ):
        """Innovations e (N, 2, B) and covariances S (N, 3, leaders) of the coordinate vectors bank (B, n).

        The first `leaders` have gains of their own, the others share those of bank[0]; of the leaders the first
        `exact` (default all) have state Jacobians of their own. None if a filter diverged.
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
        e, S = np.empty((N, 2, B)), np.empty((N, 3, leaders))
        X = np.empty((N if states else 0, self.rows))
        exact = leaders if exact is None else exact
        ok = innovations(
            *(record.t, record.y, record.u, record.weight, P, self.codes, x0, C0, noise, exact, leaders, self.sharp),
            *(self.longest_step, e, S, X),
        )
        return (e, S, X) if ok and np.isfinite(e).all() else None

    def value(self, z: NDArray[np.float64]) -> float:
        """V(z), prior included; inf where the filter diverges or M is not positive definite."""
        total = self._prior(z)[0]
        for result in self._map(lambda r: self.run(r, z[None], 1), self.records):
            if result is None:
                return math.inf
            total += _value(result[0][:, :, 0], result[1][:, :, 0])
        return total

    def expand(self, z: NDArray[np.float64], exact: bool = False, scores: bool = False) -> Expansion:
        """V, gradient and Fisher information at z.

        `exact` lets the gains follow every parameter; else they follow the noise only, which is half the cost. The
        gradient is then that of a predictor with frozen gains: it vanishes at the truth, but under a wrong model not
        quite at the minimum of V.
        """
        n = len(z)
        noisy = [i for i, c in enumerate(self.coordinates) if exact or c.noise]
        order = np.array(noisy + [i for i in range(n) if i not in noisy], dtype=np.int64)
        steps = np.array([c.step for c in self.coordinates])
        steps = np.where(z + steps > self.high, -steps, steps)
        bank = np.repeat(z[None], n + 1, axis=0)
        bank[np.arange(1, n + 1), order] += steps[order]
        rows = [np.empty((len(r.t), 5, n)) for r in self.records]
        all_scores = [np.empty((len(r.t), n)) for r in self.records]
        jobs = [(i, part) for i in range(len(self.records)) for part in _halves(len(noisy), n, len(self.records))]

        def work(job: tuple[int, NDArray[np.int64]]) -> float:
            i, part = job
            leaders = 1 + int(np.sum(part < len(noisy)))
            positions = np.concatenate([[0], part + 1])
            result = self.run(self.records[i], bank[positions], leaders, exact=leaders if exact else 1)
            if result is None:
                return math.inf
            return _differentiate(result[0], result[1], steps[order[part]], order[part], rows[i], all_scores[i])

        values = list(self._map(work, jobs))
        value, gradient, information = self._prior(z)
        if not all(map(math.isfinite, values)):
            return Expansion(math.inf, gradient, information)
        for (_, part), v in zip(jobs, values, strict=True):
            value += v if part[0] == 0 else 0.0
        for F, g in zip(rows, all_scores, strict=True):
            flat = F.reshape(-1, n)
            gradient = gradient + g.sum(axis=0)
            information = information + flat.T @ flat
        return Expansion(value, gradient, information, all_scores if scores else None)

    def _prior(self, z: NDArray[np.float64]) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
        value, gradient, information = 0.0, np.zeros(len(z)), np.zeros((len(z), len(z)))
        for i, (c, zi) in enumerate(zip(self.coordinates, z, strict=True)):
            residuals = []
            if c.prior is not None:
                residuals.append(((c.to_value(zi) - c.prior[0]) / c.prior[1], c.slope(zi) / c.prior[1]))
            if c.weak_prior is not None:
                residuals.append(((zi - c.weak_prior[0]) / c.weak_prior[1], 1.0 / c.weak_prior[1]))
            for r, slope in residuals:
                value += 0.5 * r * r
                gradient[i] += r * slope
                information[i, i] += slope * slope
        if self.physical:
            for r, slopes in self._rigid_body(z):
                value += 0.5 * r * r
                gradient += r * slopes
                information += np.outer(slopes, slopes)
        return value, gradient, information


    def _rigid_body(self, z: NDArray[np.float64]) -> list[tuple[float, NDArray[np.float64]]]:
        """Residuals and slopes that hold J1 = θ1 − θ3²/θ2 and J2 = θ4 − θ2 above a thousandth of θ1 and θ4."""

        def lacks(z: NDArray[np.float64]) -> NDArray[np.float64]:
            th = fill(self.coordinates, z, self.p, self.noise)[0]
            return np.array([1.001 * th[2] ** 2 / (th[0] * th[1]) - 1.0, 1.001 * th[1] / th[3] - 1.0]) / _STIFF

        r = lacks(z)
        if (r <= 0).all():
            return []
        slopes = np.zeros((2, len(z)))
        for i, c in enumerate(self.coordinates):
            if not c.noise and c.row < 4:
                step = np.zeros(len(z))
                step[i] = 1e-7
                slopes[:, i] = (lacks(z + step) - lacks(z - step)) / 2e-7
        return [(float(r[k]), slopes[k]) for k in range(2) if r[k] > 0]


def _sharpness_rows(codes: NDArray[np.int64]) -> NDArray[np.int64]:
    """(m, 2): rows of P that hold a friction's sharpness, and the state that its velocity is."""
    own = [offset for number, offset, _ in codes if number == NUMBERS["friction_sharpness"]]
    return np.array([(9, 2), (10, 3), *((o + i, 2 + i) for o in own for i in range(2))], dtype=np.int64)


def _halves(leaders: int, n: int, records: int) -> list[NDArray[np.int64]]:
    """Positions of a bank dealt to two threads where one record alone would leave a core idle."""
    if records > 1:
        return [np.arange(n)]
    cost = np.cumsum(np.where(np.arange(n) < leaders, 2.0, 1.0))
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


@compiled(nogil=True)
def _differentiate(e, S, steps, columns, rows, scores):
    """V of filter 0 of a bank, and the derivatives that its other filters give: see `_score_rows`.

    e (N, 2, B), S (N, 3, leaders); filter j + 1 is shifted by steps[j] in coordinate columns[j].
    """
    N, B = e.shape[0], e.shape[2]
    V = 0.0
    de, dS = np.empty(2), np.zeros(3)
    for k in range(N):
        det = S[k, 0, 0] * S[k, 2, 0] - S[k, 1, 0] ** 2
        l11 = math.sqrt(S[k, 0, 0])
        l21 = S[k, 1, 0] / l11
        l22 = math.sqrt(S[k, 2, 0] - l21 * l21)
        w1 = e[k, 0, 0] / l11
        w2 = (e[k, 1, 0] - l21 * w1) / l22
        V += 0.5 * (w1 * w1 + w2 * w2 + math.log(det))
        for j in range(1, B):
            for a in range(2):
                de[a] = (e[k, a, j] - e[k, a, 0]) / steps[j - 1]
            for a in range(3):
                dS[a] = (S[k, a, j] - S[k, a, 0]) / steps[j - 1] if j < S.shape[2] else 0.0
            _score_row(w1, w2, l11, l21, l22, de, dS, rows[k], scores[k], columns[j - 1])
    return V


@compiled(nogil=True)
def _score_row(w1, w2, l11, l21, l22, de, dS, rows, scores, i):
    """Column i of one sample's score (n,) and of the rows (5, n) whose Gram matrix is its Fisher information.

    With S = L Lᵀ, w = L⁻¹ e, d = L⁻¹ de and A = L⁻¹ dS L⁻ᵀ: score = wᵀ d + ½ tr A − ½ wᵀ A w, and the information
    d dᵀ + ½ tr A A comes from the rows d1, d2, A11/√2, A12, A22/√2.
    """
    d1 = de[0] / l11
    d2 = (de[1] - l21 * d1) / l22
    a11 = dS[0] / (l11 * l11)
    b = (dS[1] - l21 * dS[0] / l11) / l22  # (L⁻¹ dS)21
    a12 = b / l11
    a22 = ((dS[2] - l21 * dS[1] / l11) / l22 - l21 * b / l11) / l22
    rows[0, i], rows[1, i] = d1, d2
    rows[2, i], rows[3, i], rows[4, i] = a11 * math.sqrt(0.5), a12, a22 * math.sqrt(0.5)
    scores[i] = w1 * d1 + w2 * d2 + 0.5 * (a11 + a22 - w1 * w1 * a11 - 2.0 * w1 * w2 * a12 - w2 * w2 * a22)


def _scores(e, S, de, dS, noisy):
    """Per-sample gradient (N, n) of V and the summed Fisher information (n, n) of e (N, 2), S (N, 3) and their
    derivatives de (N, 2, n) and dS (N, 3, n); those of S count for the coordinates `noisy` only."""
    N, _, n = de.shape
    rows, g = np.empty((N, 5, n)), np.empty((N, n))
    counted = np.zeros_like(dS)
    counted[:, :, noisy] = dS[:, :, noisy]
    _all_rows(e, S, de, counted, rows, g)
    flat = rows.reshape(-1, n)
    return g, flat.T @ flat


@compiled(nogil=True)
def _all_rows(e, S, de, dS, rows, scores):
    for k in range(e.shape[0]):
        l11 = math.sqrt(S[k, 0])
        l21 = S[k, 1] / l11
        l22 = math.sqrt(S[k, 2] - l21 * l21)
        w1 = e[k, 0] / l11
        w2 = (e[k, 1] - l21 * w1) / l22
        for i in range(de.shape[2]):
            _score_row(w1, w2, l11, l21, l22, de[k, :, i], dS[k, :, i], rows[k], scores[k], i)


@dataclass(frozen=True)
class Optimum:
    """Where a minimisation ended: z, V there, its expansion, iterations, and whether and why it stopped."""

    z: NDArray[np.float64]
    value: float
    expansion: Expansion
    iterations: int
    converged: bool
    message: str


def _limited_step(
    A: NDArray[np.float64], g: NDArray[np.float64], damping: float, limit: float = 1.0
) -> NDArray[np.float64]:
    """Damped Newton step with no entry beyond ±limit (a factor e, or one scale).

    An entry that wants more is put at the limit and the others are solved again: scaling the whole step down instead
    would let one coordinate that hardly matters (a vanishing noise) hold up all the others.
    """
    scale = np.sqrt(np.maximum(np.diag(A), 1e-6))
    B = A / np.outer(scale, scale) + damping * np.eye(len(g))
    step, loose = np.zeros(len(g)), np.ones(len(g), dtype=bool)
    for _ in range(len(g)):
        at = ~loose
        right = -(g[loose] / scale[loose] + B[np.ix_(loose, at)] @ (step[at] * scale[at]))
        step[loose] = np.linalg.solve(B[np.ix_(loose, loose)], right) / scale[loose]
        over = loose & (np.abs(step) > limit)
        if not over.any():
            break
        step[over] = np.sign(step[over]) * limit
        loose &= ~over
        if not loose.any():
            break
    return step


def minimise(
    problem: PredictionError,
    z: NDArray[np.float64],
    iterations: int = 40,
    tolerance: float = 0.01,
    free=None,
    exact: bool = True,
) -> Optimum:
    """Levenberg–Marquardt on V from z, within the bounds. `free`: indices that move (default all).

    Goes with frozen gains while they bring V down, then, if `exact`, with exact derivatives to the minimum. Stops
    when the decrease of V that the quadratic model promises (a log-likelihood: absolute, in nats) is below
    `tolerance`. With `exact` the expansion returned is exact and holds the scores.
    """
    free = np.arange(len(z)) if free is None else np.asarray(free)
    z = np.clip(z, problem.low, problem.high)
    damping, polishing = 1e-3, False
    expansion = problem.expand(z)
    if not math.isfinite(expansion.value):
        return Optimum(z, math.inf, expansion, 0, False, "the filter diverges at the start values")
    for iteration in range(1, iterations + 1):
        trial, value, predicted, damping = _descend(problem, z, expansion, free, damping, tolerance)
        if trial is None:  # nothing lower on the way the derivatives show
            done = predicted < tolerance
            if polishing or not exact:
                message = "converged" if done else "no further descent"
                return Optimum(z, expansion.value, expansion, iteration, done, message)
            polishing, damping = True, 1e-3
        else:
            z = trial
            polishing = exact and (polishing or expansion.value - value < _POLISH)
        expansion = problem.expand(z, exact=polishing, scores=polishing)
    return Optimum(z, expansion.value, expansion, iterations, False, f"not converged in {iterations} iterations")


_RIDGE = 0.1  # nats a square unit: a coordinate that the data hardly see (a vanishing noise) stays about where it is


def _descend(problem, z, expansion, free, damping, tolerance):
    """One step that lowers V: (trial, V there, predicted decrease, damping); trial is None if there is none."""
    g, H = expansion.gradient, expansion.information
    held = (z <= problem.low) & (g > 0) | (z >= problem.high) & (g < 0)
    move = np.array([i for i in free if not held[i]], dtype=int)
    hoped = 0.5 * float(g[move] @ np.linalg.solve(H[np.ix_(move, move)] + _RIDGE * np.eye(len(move)), g[move]))
    if hoped < tolerance:
        return None, expansion.value, hoped, damping
    for _ in range(12):
        moved = _bounded_step(z, g, H, move, damping, problem.low, problem.high)
        predicted = -float(g @ moved + 0.5 * moved @ H @ moved)
        # at most a factor e, or one scale, in any parameter; for a variance the scoring step is ratio − 1, and what
        # it aims at is the logarithm of that ratio
        largest = np.abs(moved[~problem.noisy]).max(initial=1.0)
        moved = np.where(problem.noisy, np.log1p(np.clip(moved, -0.95, 20.0)), moved / largest)
        trial = np.clip(z + moved, problem.low, problem.high)
        value = problem.value(trial)
        if value < expansion.value:
            gained = expansion.value - value > 0.5 * predicted
            return trial, value, hoped, damping / 10.0 if gained else damping * 2.0
        damping = max(10.0 * damping, 1e-4)
    return None, expansion.value, hoped, damping


def _bounded_step(z, g, H, move, damping, low, high):
    """The damped Gauss–Newton step of the coordinates `move`; those that would pass a bound go to it, and the others
    make the best of that."""
    step = np.zeros_like(z)
    while len(move):
        A = H[np.ix_(move, move)]
        right = g[move] + H[move] @ step
        scale = np.sqrt(np.maximum(np.diag(A), 1e-12))
        damped = A / np.outer(scale, scale) + damping * np.eye(len(move)) + _RIDGE * np.diag(scale**-2.0)
        wanted = -np.linalg.solve(damped, right / scale) / scale
        out = (z[move] + wanted < low[move]) | (z[move] + wanted > high[move])
        if not out.any():
            step[move] = wanted
            break
        step[move[out]] = np.clip(z[move] + wanted, low[move], high[move])[out] - z[move[out]]
        move = move[~out]
    return step
