"""The stretches of long logs that say most about θ, for fits that cannot take every sample.

A log is cut into stretches of 20 s. Each has the information matrix of the paper's filtered regressor, Σ Ω_fᵀ W Ω_f,
with W = 1/variance of the residual of each row under the least-squares θ of the whole. Stretches are taken one after
another, always the one that raises log det of the sum most (greedy D-optimal; Fedorov 1972), until the budget is spent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import THETA_NAMES

from ..least_squares.filtered_model import filtered_models
from ..logs.log import Log, LogError

_SIZE = len(THETA_NAMES)

BUDGET = 300_000
"""Samples of all logs together that a fit takes: five minutes at 1 kHz."""
STRETCH = 20.0
"""Seconds of a stretch: long against the start of a filter, short enough that some differ."""
_RIDGE = 1e-9  # of the whole information, so that the first stretch has a determinant


@dataclass(frozen=True)
class Chosen:
    """logs: the logs with the samples that are used. spans: of each log, the seconds (from, to) that were chosen."""

    logs: tuple[Log, ...]
    spans: tuple[tuple[tuple[float, float], ...], ...]


@dataclass(frozen=True)
class _Stretch:
    log: int
    first: int
    stop: int
    gram: NDArray[np.float64]  # (2, 10, 10): of the rows [Ω_f, u_f] of the arm and of the pendulum


def informative(logs: Sequence[Log], budget: int = BUDGET, spread: float = 0.0) -> Chosen | None:
    """The most informative stretches, None where the logs have no more than `budget` samples together.

    spread: share of the budget that goes all along the logs, to the best stretch of each of so many equal parts, for
    who looks for what changes with time. Logs keep their order and their clocks; what is left out is a gap, at which
    prediction starts anew. A log of which nothing was chosen keeps its best stretch, as it may hold what the others
    lack.
    """
    if sum(map(len, logs)) <= budget:
        return None
    pieces = [piece for i, log in enumerate(logs) for piece in _stretches(i, log)]
    if not pieces:
        return None
    weights = _information(pieces)
    order = _greedy(pieces, weights, budget, spread)
    chosen: list[Log] = []
    spans: list[tuple[tuple[float, float], ...]] = []
    for i, log in enumerate(logs):
        joined = _joined(sorted((p.first, p.stop) for p in order if p.log == i))
        if not joined:  # too short, or with too many gaps, for the filter
            chosen.append(log)
            spans.append(((float(log.t[0]), float(log.t[-1])),))
            continue
        index = np.concatenate([np.arange(first, stop) for first, stop in joined])
        chosen.append(log.taken(index))
        spans.append(tuple((float(log.t[a]), float(log.t[b - 1])) for a, b in joined))
    return Chosen(tuple(chosen), tuple(spans))


def _stretches(number: int, log: Log) -> list[_Stretch]:
    """A log's stretches without gaps; those too short for the filter are left out."""
    found = []
    t = log.t - log.t[0]  # stamps may count from long ago
    last = max(t[-1] - 0.5 * STRETCH, 1e-9)  # a short rest belongs to the stretch before it
    cuts = np.searchsorted(t, np.arange(0.0, last, STRETCH)).tolist()
    for first, stop in zip(cuts, [*cuts[1:], len(log)], strict=True):
        if stop - first < 2:
            continue
        try:
            models = filtered_models(log.taken(slice(first, stop)))
        except LogError:
            continue
        gram = np.zeros((2, _SIZE + 1, _SIZE + 1))
        for model in models:
            for row in range(2):
                rows = np.column_stack([model.omega_f[:, row], model.u_f[:, row]])
                gram[row] += rows.T @ rows
        found.append(_Stretch(number, first, stop, gram))
    return found


def _information(pieces: Sequence[_Stretch]) -> NDArray[np.float64]:
    """(pieces, 9, 9), scaled so that the sum has ones on its diagonal."""
    total = np.sum([p.gram for p in pieces], axis=0)
    samples = sum(p.stop - p.first for p in pieces)
    both = total.sum(axis=0)
    theta = np.linalg.lstsq(both[:-1, :-1], both[:-1, -1], rcond=1e-12)[0]
    left = np.append(-theta, 1.0)
    variance = np.maximum([left @ gram @ left / samples for gram in total], 1e-300)
    weighted = np.array([np.tensordot(1.0 / variance, p.gram[:, :-1, :-1], 1) for p in pieces])
    scale = np.sqrt(np.diag(weighted.sum(axis=0)))
    scale[scale == 0] = 1.0
    return weighted / np.outer(scale, scale)


def _greedy(pieces: Sequence[_Stretch], weights: NDArray[np.float64], budget: int, spread: float) -> list[_Stretch]:
    """The pieces in the order in which they were taken: within the budget, and at least one of each log."""
    taken: list[int] = []
    total = _RIDGE * np.eye(_SIZE)
    left, rest, missing = budget, list(range(len(pieces))), {p.log for p in pieces}
    size = [p.stop - p.first for p in pieces]
    parts = int(spread * budget / np.mean(size))
    among = [set(part.tolist()) for part in np.array_split(np.arange(len(pieces)), parts)] if parts else []
    while allowed := [k for k in rest if size[k] <= left] or [k for k in rest if pieces[k].log in missing]:
        if among:
            first = among.pop(0)
            allowed = [k for k in allowed if k in first] or allowed
        best = allowed[int(np.argmax(np.linalg.slogdet(total + weights[allowed])[1]))]
        taken.append(best)
        rest.remove(best)
        missing.discard(pieces[best].log)
        total = total + weights[best]
        left -= size[best]
    return [pieces[k] for k in taken]


def _joined(spans: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """Spans of samples in order, those that touch as one."""
    joined: list[tuple[int, int]] = []
    for first, stop in spans:
        if joined and joined[-1][1] == first:
            joined[-1] = joined[-1][0], stop
        else:
            joined.append((first, stop))
    return joined


def spans_text(stretches: Sequence[Sequence[tuple[float, float]]]) -> str:
    """Seconds of each log, as "12–32, 80–120 s"."""
    each = [", ".join(f"{a:.4g}–{b:.4g}" for a, b in spans) + " s" for spans in stretches]
    return each[0] if len(each) == 1 else "; ".join(f"{text} of log {i}" for i, text in enumerate(each, 1))
