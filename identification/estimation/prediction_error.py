"""Maximum likelihood through the Kalman filter's innovations (the prediction-error method).

Minimises V(z) = −log L = ½ Σ (eᵀ S⁻¹ e + ln det S), for rounded readings its counterpart (`rounding.cell`), over
θ, r, effect parameters and noise intensities together, for any number of logs (Kristensen, Madsen & Jørgensen 2004;
Ljung 1999, ch. 7). Works on closed-loop data of the unstable plant and needs no velocities. Derivatives come from a
bank of filters; `optimise` does the descent.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from concurrent.futures import Executor
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import Plant
from furuta_gym.plant.layout import N_BASE

from ..kalman.arguments import BankResult, Gaussian, LeaderReadings, Model
from ..kalman.bank import innovations, whole_registers
from ..kalman.coordinates import Coordinate, Zeros, filled_noise, filled_parameters, filled_plant, filled_zeros
from ..kalman.likelihood import differentiate
from ..kalman.noise_model import READING, Noise
from ..kalman.record import Record
from ..kalman.sharpness import sharpness_rows
from .optimise import Expansion
from .pool import in_shared_pool, mapped, threads
from .priors import Priors
from .steps import CommonScale, LinearEffect

_VAGUE = 100.0  # times a reading's variance: how little is known of an angle before the first reading
_BANDWIDTH = 3.0  # rad/s
_SOFT = 0.05  # of the rounding's variance, see `_before_rounding`
_FEWEST = 4  # filters with a Jacobian of their own, in a part of a bank


class _Differences(NamedTuple):
    """V of the filters alone; of every record, rows (N, 5, n) of the information and scores (N, n)."""

    value: float
    rows: list[NDArray[np.float64]]
    scores: list[NDArray[np.float64]]


class PredictionError:
    """The objective V over the free `coordinates` of a plant and the noise, on `records`.

    plant: supplies the structure (effects) and the values of everything that is not free.
    noise: where it is not free.
    coarser: factor on the integration step that friction allows, for a first look. pool: where filters
    run side by side (None: in the caller's own thread, as inside a task of a pool they must). physical: penalise what
    no rigid body has. zeros: of the logs' encoders, where they are not free.
    """

    def __init__(
        self,
        plant: Plant,
        records: Sequence[Record],
        coordinates: Sequence[Coordinate],
        noise: Noise,
        coarser: float = 1.0,
        pool: Executor | None = None,
        physical: bool = False,
        zeros: Zeros | None = None,
    ) -> None:
        packed = plant.packed()
        self._plant = plant
        self.p, self.codes, self.rows = packed.p, packed.codes, packed.rows
        self.records, self.coordinates, self.noise = list(records), list(coordinates), noise
        self.coarser, self.zeros = coarser, dict(zeros or {})
        self.sharp = sharpness_rows(plant.layout)
        self.priors, self.pool = Priors(tuple(self.coordinates), self.p, physical), pool
        bounds = np.array([c.z_bounds for c in self.coordinates])
        self.low, self.high = bounds[:, 0], bounds[:, 1]
        for i, c in enumerate(self.coordinates):  # rounding is the least noise that a rounded reading has
            axis = c.row - READING.start
            if c.noise and axis >= 0 and all(r.quantum[axis] > 0 for r in self.records):
                least = min(math.log(r.quantum[axis] ** 2 / 12.0 / r.variance[axis]) for r in self.records)
                self.low[i] = max(self.low[i], min(least, 0.0))
        self._scale = CommonScale.among(plant, self.coordinates)
        self._linear = LinearEffect.among(plant, self.coordinates)
        self.noisy = np.array([c.noise for c in self.coordinates])
        self.logarithmic = np.array([c.log for c in self.coordinates])

    def on(self, records: Sequence[Record]) -> PredictionError:
        """The same on other records of the same logs."""
        other = copy.copy(self)
        other.records = list(records)
        return other

    def alone(self) -> PredictionError:
        """The same in the caller's own thread, as a task of a pool needs it."""
        other = copy.copy(self)
        other.pool = None
        return other

    def start(self) -> NDArray[np.float64]:
        """The coordinates of the plant and noise given."""
        z = [c.to_z(self._given(c)) for c in self.coordinates]
        return np.clip(np.array(z), self.low, self.high)

    def _given(self, c: Coordinate) -> float:
        if c.zero_of is not None:
            return self.zeros.get(c.zero_of, (0.0, 0.0))[c.row]
        return float((self.noise.packed() if c.noise else self.p)[c.row])

    def run(
        self, record: Record, bank: NDArray[np.float64], leaders: int, states: bool = False, exact: int | None = None
    ):
        """Innovations e (N, 2, B) and covariances S (N, 3, leaders) of the coordinate vectors bank (B, n).

        The first `leaders` have gains of their own, the others share those of bank[0]; of the leaders the first
        `exact` (default all) have state Jacobians of their own. Third: the filtered states (N, rows) of bank[0], if
        `states`. None if a filter diverged.
        """
        result = self._filter(record, bank, leaders, leaders if exact is None else exact, states)
        if result is None:
            return None
        e, S, direct = result.e, result.S, result.direct
        # the plain innovations of rounded readings, with rounding as a variance: their size is what S says
        e += (direct[:, :2] - e[:, :, 0])[:, :, None]
        rounding = np.where(record.quantum > 0, record.quantum**2 / 12.0, 0.0)
        S[:, [0, 2]] += (rounding - direct[:, 2:])[:, :, None]
        return e, S, result.states

    def _filter(
        self, record: Record, bank: NDArray[np.float64], leaders: int, exact: int, states: bool = False
    ) -> BankResult | None:
        """What `innovations` makes of a record, None if a filter diverged."""
        P = np.ascontiguousarray(np.array([filled_parameters(self.coordinates, z, self.p) for z in bank]).T)
        found = [filled_noise(self.coordinates, z, self.noise).on(record).packed() for z in bank]
        noise = np.ascontiguousarray(np.array(found).T)
        noise[READING] = _before_rounding(noise[READING], record.quantum[:, None])
        B, N = len(bank), len(record.t)
        if not np.isfinite(P[:N_BASE]).all() or np.any(P[0] * P[3] <= P[2] ** 2):
            return None
        zeros = np.ascontiguousarray(
            np.array([filled_zeros(self.coordinates, z, record.log, self.zeros) for z in bank]).T
        )
        x0 = record.first_state(P, self.codes, self.rows, zeros)
        C0 = record.first_covariance(self.codes, self.rows, _VAGUE)
        result = BankResult(
            e=np.empty((N, 2, B)),
            S=np.empty((N, 3, leaders)),
            cost=np.empty((N, leaders)),
            direct=np.empty((N, 4)),
            states=np.empty((N if states else 0, self.rows)),
        )
        model, first = Model(P, self.codes, self.sharp), Gaussian(x0, C0)
        told = LeaderReadings.empty(self.rows, whole_registers(leaders))
        ok = innovations(record.readings, model, first, noise, zeros, exact, leaders, self.coarser, result, told)
        return result if ok and np.isfinite(result.cost).all() and np.isfinite(result.e).all() else None

    def plant_at(self, z: NDArray[np.float64]) -> Plant:
        """The plant at z. Raises ValueError where the values make none."""
        return filled_plant(self._plant, self.coordinates, z)

    def noise_at(self, z: NDArray[np.float64]) -> Noise:
        """The noise at z."""
        return filled_noise(self.coordinates, z, self.noise)

    def zeros_at(self, z: NDArray[np.float64]) -> dict[int, tuple[float, float]]:
        """Zeros of the encoders in every log, at z."""
        logs = sorted({r.log for r in self.records})
        found = {i: filled_zeros(self.coordinates, z, i, self.zeros) for i in logs}
        return {i: (float(x[0]), float(x[1])) for i, x in found.items() if x.any()}

    def moved(
        self, z: NDArray[np.float64], step: NDArray[np.float64], information: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Where a step from z ends: within the bounds, and bent as scale and effects ask for (see `steps`)."""
        end = np.clip(z + step, self.low, self.high)
        if self._scale is not None:
            end = np.clip(self._scale.bent(z, end), self.low, self.high)
        for effect in self._linear:
            end = effect.bent(z, end, information)
        return end

    def axes(self, z: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, n), in columns: the directions that damping holds back, each by its own curvature."""
        return np.eye(len(z)) if self._scale is None else self._scale.axes(z)

    def reach(self, z: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n,): how far a single step may lead: a factor e of a logarithm, else the value's own size or one scale."""
        return np.where(self.logarithmic, 1.0, np.maximum(1.0, np.abs(z)))

    def value(self, z: NDArray[np.float64]) -> float:
        """V(z), prior included; inf where the filter diverges or M is not positive definite."""
        total = self.priors.at(z)[0]
        for result in mapped(self.pool, lambda r: self._filter(r, z[None], 1, 1), self.records):
            if result is None:
                return math.inf
            total += float(np.sum(result.cost))
        return total

    def expand(
        self, z: NDArray[np.float64], exact: bool = False, scores: bool = False, central: bool = False
    ) -> Expansion:
        """V, gradient and Fisher information at z.

        `exact` lets the gains follow every parameter; else they follow the noise only, which is half the cost. The
        gradient is then that of a predictor with frozen gains: it vanishes at the truth, but under a wrong model not
        quite at the minimum of V. `central`: differences to both sides, at twice the cost. Where parameters imitate
        each other, the curvature of a one-sided difference passes for information that the data do not hold.
        """
        n = len(z)
        steps = np.array([c.step for c in self.coordinates])
        steps = np.where(z + steps > self.high, -steps, steps)
        back = np.where((z - steps < self.low) | (z - steps > self.high), steps, -steps)
        answers = self._differences(z, [steps, back] if central else [steps], exact)
        value, gradient, information = self.priors.at(z)
        found = [side for side in answers if side is not None]
        if not found:  # one side alone will do, where the other has no plant
            return Expansion(math.inf, gradient, information)
        value += found[0].value
        slopes = [_mean(sides) for sides in zip(*(side.scores for side in found), strict=True)]
        for sides, g in zip(zip(*(side.rows for side in found), strict=True), slopes, strict=True):
            flat = _mean(sides).reshape(-1, n)
            gradient = gradient + g.sum(axis=0)
            information = information + flat.T @ flat
        return Expansion(value, gradient, information, slopes if scores else None)

    def _differences(
        self, z: NDArray[np.float64], sides: Sequence[NDArray[np.float64]], exact: bool
    ) -> list[_Differences | None]:
        """For each side, what filters shifted by its steps (n,) say; None where one diverged."""
        n, records = len(z), self.records
        noisy = [i for i, c in enumerate(self.coordinates) if exact or c.noise]
        order = np.array(noisy + [i for i in range(n) if i not in noisy], dtype=np.int64)
        filled = [[(np.zeros((len(r.t), 5, n)), np.zeros((len(r.t), n))) for r in records] for _ in sides]
        free = 1 if self.pool is None or in_shared_pool() else threads()
        jobs = []
        for i, record in enumerate(records):
            # the zeros of other logs do nothing here
            own = np.array([self.coordinates[j].zero_of in (None, record.log) for j in order], dtype=bool)
            leaders = int(np.sum(own[: len(noisy)]))
            parts = _dealt_out(leaders, int(own.sum()), exact, free // (len(sides) * len(records)))
            jobs += [(side, i, order[own][part], k == 0) for side in range(len(sides)) for k, part in enumerate(parts)]

        def work(job: tuple[int, int, NDArray[np.int64], bool]) -> float:
            side, i, at, _ = job
            leaders = 1 + int(np.sum([exact or self.coordinates[j].noise for j in at]))
            bank = np.repeat(z[None], len(at) + 1, axis=0)
            bank[np.arange(1, len(at) + 1), at] += sides[side][at]
            result = self._filter(records[i], bank, leaders, leaders if exact else 1)
            if result is None:
                return math.inf
            return differentiate(*result[:3], sides[side][at], at, *filled[side][i])

        values = np.zeros(len(sides))
        for (side, _, _, first), value in zip(jobs, mapped(self.pool, work, jobs), strict=True):
            values[side] += value if first or math.isinf(value) else 0.0
        return [
            _Differences(float(value), *map(list, zip(*arrays, strict=True))) if math.isfinite(value) else None
            for value, arrays in zip(values, filled, strict=True)
        ]

    def prior_cost(self, z: NDArray[np.float64]) -> float:
        """What priors, and the rigid body if asked for, add to V at z."""
        return self.priors.at(z)[0]


def _mean(sides: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Of what differences to one side or to both say; a single one is not copied."""
    return sides[0] if len(sides) == 1 else 0.5 * (sides[0] + sides[1])


def quietest(plant: Plant, records: Sequence[Record]) -> NDArray[np.float64]:
    """(2,) torque noise [{u}² s] below which none is told from some: what keeps a filter's bandwidth at `_BANDWIDTH`.

    Without torque noise the filter forgets nothing, and V is as rough as a free run of the unstable plant over the
    whole log: no descent gets through. With this much it forgets within a fraction of a second, which costs next to
    no precision.
    """
    density = np.max([r.variance * float(np.median(np.diff(r.t))) for r in records], axis=0)
    return (plant.theta[[0, 3]] * _BANDWIDTH**2) ** 2 * density


def _before_rounding(total: NDArray[np.float64], quantum: NDArray[np.float64]) -> NDArray[np.float64]:
    """Variance of readings before they are rounded, from the total one: less quantum²/12, softly above zero."""
    rounding = quantum**2 / 12.0
    rest = total - rounding
    return 0.5 * (rest + np.sqrt(rest**2 + (_SOFT * rounding) ** 2))


def _dealt_out(leaders: int, n: int, exact: bool, most: int) -> list[NDArray[np.int64]]:
    """Positions of a bank in at most so many parts, which take about as long as each other. Each part filters the
    leader anew, so exact ones hold four filters at least, and a bank with frozen gains is halved at most."""
    parts = max(1, min(most, n // _FEWEST if exact else 2))
    cost = np.where(np.arange(n) < leaders, 2.0, 1.0)
    middle = (np.cumsum(cost) - 0.5 * cost) / cost.sum()
    return [part for part in (np.flatnonzero((middle * parts).astype(int) == i) for i in range(parts)) if part.size]
