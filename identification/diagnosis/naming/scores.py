"""Score tests: how much every effect of the library would gain, before any of them is fitted.

The score is the projected Lagrange-multiplier test (Benveniste, Basseville & Moustakides 1987): how much of the
whitened innovations an effect's first-order answer explains once the answers of all free parameters are taken out, of
the encoders' zeros too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import EFFECTS, Effect, Plant

from ...discrepancy.correction import HIGHEST_FREQUENCY
from ...estimation.grids import clock_of
from ...estimation.pool import mapped, shared_pool
from ...estimation.prediction_error import PredictionError, quietest
from ...kalman.coordinates import Coordinate, tells_the_zero
from ...kalman.likelihood import whiten
from ...kalman.noise_model import Noise
from ...kalman.record import Record
from ...normal_equations import ScaledGram
from ..policy import DecisionPolicy
from .fits import COARSER, Fit
from .probes import Cell, cells

_PEAKS = 5  # of the spectrum, that are tried
_CHUNK = 48  # probes in one pass of the bank


@dataclass(frozen=True)
class Score:
    """Predicted gain of log-likelihood [nats] of an effect, the start that it suggests, and how much of the effect's
    answer the free parameters could imitate (`absorbed`: 1 = all of it)."""

    effect: str
    gain: float
    start: Effect | None
    absorbed: float


def scores(
    nominal: Fit,
    names: Sequence[str] | None = None,
    quieter: float = 1.0,
    policy: DecisionPolicy = DecisionPolicy(),  # noqa: B008  (frozen)
) -> dict[str, Score]:
    """Score of every effect not yet in the model. `quieter` divides the torque noise, which hides what it has been
    fitted to explain; scores then rank, but are no longer gains."""
    least = quietest(nominal.plant, nominal.records)
    noise = Noise(np.maximum(nominal.noise.torque / quieter, least), nominal.noise.reading_factor)
    taken = {e.name for e in nominal.plant.effects}
    peak = max(float(np.abs(r.u).max()) for r in nominal.records)
    scale = nominal.plant.replace(u_max=max(peak, 1e-6))
    frequencies = _peaks(nominal, noise, policy.periods)
    chosen = [n for n in (names or EFFECTS) if n not in taken]
    trial = {name: cells(EFFECTS[name], scale, clock_of(nominal.records), frequencies) for name in chosen}
    tables = [_answers(nominal, noise, record, [c for n in chosen for c in trial[n]]) for record in nominal.moved]
    found: dict[str, Score] = {}
    position = 0
    for name in chosen:
        absorbed, suggested = 1.0, []
        for cell in trial[name]:
            gram = sum(t.gram[position] for t in tables)
            raw = sum(t.raw[position] for t in tables)
            right = sum(t.right[position] for t in tables)
            position += 1
            gain, weights = _best_weights(gram, right)
            absorbed = min(absorbed, 1.0 - float(np.trace(gram)) / max(raw, 1e-300))
            if weights is not None and gain > 0.0:
                suggested.append((gain, cell, weights, np.asarray(gram)))
        gain, start = _best_start(suggested)
        found[name] = Score(name, gain, start, absorbed)
    return found


def _peaks(nominal: Fit, noise: Noise, periods: float) -> NDArray[np.float64]:
    """Frequencies [Hz] of the largest peaks in the whitened innovations of the longest record, each bracketed."""
    record = max(nominal.moved, key=lambda r: r.duration)
    problem = PredictionError(nominal.plant, [record], nominal.coordinates[:1], noise)
    result = problem.run(record, nominal.optimum.z[None, :1], 1)
    if result is None:
        return np.array([1.0])
    w = whiten(result[0][:, :, 0], result[1][:, :, 0])
    n = len(w)
    power = np.abs(np.fft.rfft(w - w.mean(axis=0), 4 * n, axis=0)) ** 2
    f = np.fft.rfftfreq(4 * n, float(np.median(np.diff(record.t))))
    total = np.where((f > periods / record.duration) & (f < HIGHEST_FREQUENCY), power.sum(axis=1), 0.0)
    cell, found = 1.0 / record.duration, []
    for _ in range(_PEAKS):
        top = f[int(np.argmax(total))]
        found += [top - 0.25 * cell, top, top + 0.25 * cell]
        total[np.abs(f - top) < 1.5 * cell] = 0.0
    return np.array(found)


def _best_start(suggested: list[tuple[float, Cell, NDArray[np.float64], NDArray[np.float64]]]):
    """Gain and effect of the best cell whose weights stand for an effect; a start takes time, so only as many as need
    be are made."""
    for gain, cell, weights, gram in sorted(suggested, key=lambda entry: -entry[0]):
        if (start := cell.start(weights, gram)) is not None:
            return gain, start
    return 0.0, None


def _best_weights(gram, right):
    scaled = ScaledGram.of(gram)
    if not np.isfinite(right).all() or scaled.scale.max() < 1e-100:
        return 0.0, None
    weights = np.linalg.lstsq(scaled.matrix, right / scaled.scale, rcond=1e-8)[0] / scaled.scale
    return 0.5 * float(weights @ right), weights


@dataclass(frozen=True)
class _Free:
    """What the free numbers of a fit do to one record: orthonormal bases (2 N + zeros, n) of their whitened answers,
    w0 the whitened innovations, S (N, 3) their covariances. The last `zeros` rows are those of the zeros' priors."""

    w0: NDArray[np.float64]
    S: NDArray[np.float64]
    basis: NDArray[np.float64]
    without_zeros: NDArray[np.float64]
    zeros: int

    @classmethod
    def on(cls, nominal: Fit, noise: Noise, record: Record) -> _Free:
        """record: with its zeros taken off. Raises ValueError where the filter diverges."""
        own = [
            (c, zi)
            for c, zi in zip(nominal.coordinates, nominal.optimum.z, strict=True)
            if c.of_plant or (c.zero_of == record.log and _within(c, zi))
        ]
        coordinates, z = [c for c, _ in own], np.array([zi if c.of_plant else 0.0 for c, zi in own])
        base = PredictionError(nominal.plant, [record], coordinates, noise)
        steps = np.array([c.step for c in coordinates])
        bank = np.repeat(z[None], len(z) + 1, axis=0)
        bank[np.arange(1, len(z) + 1), np.arange(len(z))] += steps
        result = base.run(record, bank, 1)
        if result is None:
            raise ValueError("the filter diverges at the fitted model; the fit has not converged")
        e, S, _ = result
        S = S[:, :, 0]
        answers = whiten((e[:, :, 1:] - e[:, :, :1]) / steps, S).reshape(2 * len(S), -1)
        of_zeros = [i for i, c in enumerate(coordinates) if not c.of_plant]
        rows, known = np.zeros((len(of_zeros), len(z))), np.zeros(len(of_zeros))
        for row, i in enumerate(of_zeros):
            c, zi = own[i]
            mean, std = c.prior or (0.0, math.inf)
            rows[row, i], known[row] = c.scale / std, (c.to_value(zi) - mean) / std
        answers = np.concatenate([answers, rows])
        w0 = np.concatenate([whiten(e[:, :, 0], S).ravel(), known])
        of_plant = np.delete(answers, of_zeros, axis=1)
        return cls(w0, S, np.linalg.qr(answers)[0], np.linalg.qr(of_plant)[0], len(of_zeros))


def _within(c: Coordinate, z: float) -> bool:
    """Whether a zero is free to move: one that a fit has left at its limit is not."""
    low, high = c.z_bounds
    return low < z < high


@dataclass
class _Answers:
    gram: list
    raw: list
    right: list


def _answers(nominal: Fit, noise: Noise, record: Record, trial: Sequence[Cell]) -> _Answers:
    """For each cell: projected Gram matrix, unprojected square, and inner product with the innovations."""
    free = _Free.on(nominal, noise, record)
    S, zeros, first = free.S, free.zeros, min(r.log for r in nominal.records)
    found = _Answers([], [], [])
    groups = _grouped(trial)
    for group, de in zip(
        groups, mapped(shared_pool(), lambda g: _probe_answers(nominal.plant, noise, record, g), groups), strict=True
    ):
        if de is None:
            for cell in group:
                k = len(cell.probes)
                found.gram.append(np.zeros((k, k)))
                found.raw.append(0.0)
                found.right.append(np.zeros(k))
            continue
        told = record.log == first and tells_the_zero(nominal.plant.with_effects(Effect(group[0].effect)))
        Q = free.without_zeros if told else free.basis
        w0 = free.w0 - Q @ (Q.T @ free.w0)
        raw = whiten(de, S).reshape(2 * len(S), -1)
        raw = np.concatenate([raw, np.zeros((zeros, raw.shape[1]))])
        left = raw - Q @ (Q.T @ raw)
        at = 0
        for cell in group:
            part = slice(at, at + len(cell.probes))
            at += len(cell.probes)
            found.gram.append(left[:, part].T @ left[:, part])
            found.raw.append(float(np.sum(raw[:, part] ** 2)))
            found.right.append(-left[:, part].T @ w0)
    return found


def _grouped(trial: Sequence[Cell]) -> list[list[Cell]]:
    """Runs of cells of one effect, short enough for one pass."""
    groups: list[list[Cell]] = []
    for cell in trial:
        full = groups and sum(len(c.probes) for c in groups[-1]) + len(cell.probes) > _CHUNK
        if not groups or full or groups[-1][0].effect != cell.effect:
            groups.append([])
        groups[-1].append(cell)
    return groups


def _probe_answers(plant: Plant, noise: Noise, record: Record, group: Sequence[Cell]) -> NDArray[np.float64] | None:
    """Change of the innovations (N, 2, probes) when each probe of one effect's cells is switched on, gains held."""
    effect, probes = group[0].effect, [p for cell in group for p in cell.probes]
    first = plant.with_effects(Effect(effect))
    names = EFFECTS[effect].parameter_names
    coordinates = [Coordinate(f"{effect}.{n}", first.layout.row(f"{effect}.{n}"), log=False) for n in names]
    problem = PredictionError(first, [record], coordinates, noise, coarser=COARSER)
    switched_off = Effect(effect).parameters
    neutral = [switched_off[n] for n in names]
    bank = np.array([neutral, *[[p[n] for n in names] for p in probes]])
    result = problem.run(record, bank, 1)
    return None if result is None else result[0][:, :, 1:] - result[0][:, :, :1]
