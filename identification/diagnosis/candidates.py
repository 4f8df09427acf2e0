"""Score every effect of the library against a fitted model, and refit the ones worth it.

The score is the projected Lagrange-multiplier test (Benveniste, Basseville & Moustakides 1987): how much of the
whitened innovations an effect's first-order answer explains once the answers of all free parameters are taken out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import EFFECTS, Effect, Plant

from ..coordinates import Coordinate, fill, filled_plant, noise_coordinates, plant_coordinates
from ..prediction_error import THREADS, Optimum, PredictionError, Record, minimise, quietest, whiten
from .probes import Cell, cells

ANCHOR_STD = 0.5
_CHUNK = 48  # probes in one pass of the bank
_COARSER = 2.0  # times the integration step
_TOLERANCE = 0.05  # nats, of the optimum
PERIODS = 2.0  # in the longest piece of a log: slower than that is a drift, of which no log can say that it repeats


@dataclass(frozen=True)
class Fit:
    """A plant fitted to records: the structure, where the optimiser ended, and V there."""

    plant: Plant
    noise: NDArray[np.float64]
    coordinates: tuple[Coordinate, ...]
    optimum: Optimum
    records: tuple[Record, ...]

    @property
    def value(self) -> float:
        return self.optimum.value

    @property
    def size(self) -> int:
        """Number of estimated coordinates."""
        return len(self.coordinates)

    @property
    def samples(self) -> int:
        return sum(2 * len(r.t) for r in self.records)

    def problem(self) -> PredictionError:
        return PredictionError(self.plant, self.records, self.coordinates, self.noise)


def fit(
    plant: Plant,
    noise: NDArray[np.float64],
    records: Sequence[Record],
    anchor: Plant | None = None,
    iterations: int = 40,
    coarse: bool = False,
) -> Fit:
    """Fit θ, effect parameters and noise jointly from the values in `plant` and `noise`.

    coarse: with longer integration steps and frozen gains, on one thread: within a nat or so, for a race of many.
    """
    coordinates = plant_coordinates(plant, free_sharpness=False)
    coordinates += noise_coordinates(quietest(anchor or plant, records))
    if anchor is not None:
        coordinates = [anchored(c, anchor) for c in coordinates]
    coordinates = [repeating(c, max(r.duration for r in records)) for c in coordinates]
    step = _COARSER if coarse else 1.0
    problem = PredictionError(plant, records, coordinates, noise, coarser=step, parallel=not coarse)
    optimum = minimise(problem, problem.start(), iterations, _TOLERANCE, exact=not coarse)
    _, noise = fill(coordinates, optimum.z, problem.p, problem.noise)
    return Fit(filled_plant(plant, coordinates, optimum.z), noise, tuple(coordinates), optimum, tuple(records))


def anchored(c: Coordinate, anchor: Plant) -> Coordinate:
    """θ1 … θ5 with a weak log-normal prior (a factor e^0.5) around the anchor's.

    The pendulum's row has no input: θ3, θ4, θ5, θ7, θ9 share a scale that only the reaction on the arm fixes, and a
    missing effect leaks into that direction until nothing can be named any more.
    """
    if c.noise or c.row > 4 or not c.log:
        return c
    return replace(c, weak_prior=(math.log(anchor.theta[c.row]), ANCHOR_STD))


def repeating(c: Coordinate, duration: float) -> Coordinate:
    """A frequency [Hz] kept to what repeats within a log of some duration [s]; any other coordinate as it is."""
    effect, _, parameter = c.name.partition(".")
    declared = EFFECTS[effect].parameters if effect in EFFECTS else ()
    repeats = any(p.name == parameter and p.grid == "frequencies" for p in declared)
    return replace(c, low=max(c.low, PERIODS / duration)) if repeats else c


@dataclass(frozen=True)
class Score:
    """Predicted gain of log-likelihood [nats] of an effect, the start that it suggests, and how much of the effect's
    answer the free parameters could imitate (`absorbed`: 1 = all of it)."""

    effect: str
    gain: float
    start: Effect | None
    absorbed: float


def scores(nominal: Fit, names: Sequence[str] | None = None, quieter: float = 1.0) -> dict[str, Score]:
    """Score of every effect not yet in the model. `quieter` divides the torque noise, which hides what it has been
    fitted to explain; scores then rank, but are no longer gains."""
    noise = nominal.noise.copy()
    noise[:2] = np.maximum(noise[:2] / quieter, quietest(nominal.plant, nominal.records))
    taken = {e.name for e in nominal.plant.effects}
    peak = max(float(np.abs(r.u).max()) for r in nominal.records)
    duration = max(float(r.t[-1]) for r in nominal.records)
    scale = nominal.plant.replace(u_max=max(peak, 1e-6))
    frequencies = _peaks(nominal, noise)
    chosen = [n for n in (names or EFFECTS) if n not in taken]
    trial = {name: cells(EFFECTS[name], scale, duration, frequencies) for name in chosen}
    tables = [_answers(nominal, noise, record, [c for n in chosen for c in trial[n]]) for record in nominal.records]
    found: dict[str, Score] = {}
    position = 0
    for name in chosen:
        best = Score(name, 0.0, None, 1.0)
        absorbed = 1.0
        for cell in trial[name]:
            gram = sum(t.gram[position] for t in tables)
            raw = sum(t.raw[position] for t in tables)
            right = sum(t.right[position] for t in tables)
            position += 1
            gain, weights = _best_weights(gram, right)
            absorbed = min(absorbed, 1.0 - float(np.trace(gram)) / max(raw, 1e-300))
            if weights is not None and gain > best.gain:
                start = cell.start(weights, np.asarray(gram))
                if start is not None:
                    best = Score(name, gain, start, absorbed)
        found[name] = Score(name, best.gain, best.start, absorbed)
    return found


def _peaks(nominal: Fit, noise: NDArray[np.float64], most: int = 5) -> NDArray[np.float64]:
    """Frequencies [Hz] of the largest peaks in the whitened innovations of the longest record, each bracketed."""
    record = max(nominal.records, key=lambda r: r.duration)
    problem = PredictionError(nominal.plant, [record], nominal.coordinates[:1], noise)
    result = problem.run(record, nominal.optimum.z[None, :1], 1)
    if result is None:
        return np.array([1.0])
    w = whiten(result[0][:, :, 0], result[1][:, :, 0])
    n = len(w)
    power = np.abs(np.fft.rfft(w - w.mean(axis=0), 4 * n, axis=0)) ** 2
    f = np.fft.rfftfreq(4 * n, float(np.median(np.diff(record.t))))
    total = np.where((f > PERIODS / record.duration) & (f < 25.0), power.sum(axis=1), 0.0)
    cell, found = 1.0 / record.duration, []
    for _ in range(most):
        top = f[int(np.argmax(total))]
        found += [top - 0.25 * cell, top, top + 0.25 * cell]
        total[np.abs(f - top) < 1.5 * cell] = 0.0
    return np.array(found)


def _best_weights(gram, right):
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    if not np.isfinite(right).all() or scale.max() < 1e-100:
        return 0.0, None
    weights = np.linalg.lstsq(gram / np.outer(scale, scale), right / scale, rcond=1e-8)[0] / scale
    return 0.5 * float(weights @ right), weights


@dataclass
class _Answers:
    gram: list
    raw: list
    right: list


def _answers(nominal: Fit, noise, record: Record, trial: Sequence[Cell]) -> _Answers:
    """For each cell: projected Gram matrix, unprojected square, and inner product with the innovations."""
    coordinates = [c for c in nominal.coordinates if not c.noise]
    z = np.array([zi for c, zi in zip(nominal.coordinates, nominal.optimum.z, strict=True) if not c.noise])
    base = PredictionError(nominal.plant, [record], coordinates, noise)
    steps = np.array([c.step for c in coordinates])
    bank = np.repeat(z[None], len(z) + 1, axis=0)
    bank[np.arange(1, len(z) + 1), np.arange(len(z))] += steps
    result = base.run(record, bank, 1)
    if result is None:
        raise ValueError("the filter diverges at the fitted model; the fit has not converged")
    e, S, _ = result
    w0 = whiten(e[:, :, 0], S[:, :, 0]).ravel()
    nuisance = whiten((e[:, :, 1:] - e[:, :, :1]) / steps, S[:, :, 0]).reshape(len(w0), -1)
    Q = np.linalg.qr(nuisance)[0]
    w0 = w0 - Q @ (Q.T @ w0)
    found = _Answers([], [], [])
    groups = _grouped(trial)
    for group, de in zip(
        groups, THREADS.map(lambda g: _probe_answers(nominal.plant, noise, record, g), groups), strict=True
    ):
        if de is None:
            for cell in group:
                k = len(cell.probes)
                found.gram.append(np.zeros((k, k)))
                found.raw.append(0.0)
                found.right.append(np.zeros(k))
            continue
        raw = whiten(de, S[:, :, 0]).reshape(len(w0), -1)
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


def _probe_answers(plant: Plant, noise, record: Record, group: Sequence[Cell]) -> NDArray[np.float64] | None:
    """Change of the innovations (N, 2, probes) when each probe of one effect's cells is switched on, gains held."""
    effect, probes = group[0].effect, [p for cell in group for p in cell.probes]
    first = plant.with_effects(Effect(effect))
    row = 11  # of the effect's first parameter
    for other in first.effects:
        if other.name == effect:
            break
        row += len(other.parameters)
    names = EFFECTS[effect].parameter_names
    coordinates = [Coordinate(f"{effect}.{n}", row + i, log=False) for i, n in enumerate(names)]
    problem = PredictionError(first, [record], coordinates, noise, coarser=_COARSER)
    switched_off = Effect(effect).parameters
    neutral = [switched_off[n] for n in names]
    bank = np.array([neutral, *[[p[n] for n in names] for p in probes]])
    result = problem.run(record, bank, 1)
    return None if result is None else result[0][:, :, 1:] - result[0][:, :, :1]
