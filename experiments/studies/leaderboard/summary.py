"""Figures over trials and training seeds, with intervals that know of both."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from controllers.statistics import Interval, interquartile_mean, success_rate

from .blocks import Block

RESAMPLES = 2000
WORST = 0.05


@dataclass(frozen=True)
class Cell:
    """One contestant in one condition. seeds: of its training. success: of all trials, with an interval over seeds and
    trials; each: success of each seed. settling [s], roughness [{u}/s], energy [{u}² s]: typical (interquartile mean of
    the successful trials) and the mean of the worst 5 %; trials that failed count in worst_settling with the whole
    duration. left_travel: trials in which the arm left its travel. largest_q1 [rad]: of all successful trials."""

    contestant: str
    condition: str
    seeds: int
    trials: int
    success: Interval
    each: tuple[float, ...]
    settling: Interval
    worst_settling: float
    roughness: Interval
    energy: Interval
    largest_q1: float
    left_travel: int


def cell(blocks: Sequence[Block], duration: float) -> Cell:
    """Sum up the blocks of one contestant in one condition, one for each seed."""
    won = [np.array(b.success, dtype=float) for b in blocks]
    times = np.concatenate(
        [np.where(np.array(b.success, dtype=bool), np.array(b.figures["settling"]), duration) for b in blocks]
    )
    reached = np.concatenate([b.array("largest_q1") for b in blocks])
    slowest = np.sort(times)[-max(1, round(WORST * times.size)) :]
    return Cell(
        contestant=blocks[0].contestant,
        condition=blocks[0].condition,
        seeds=len(blocks),
        trials=int(times.size),
        success=over_seeds_rate(won),
        each=tuple(float(w.mean()) for w in won),
        settling=over_seeds([b.array("settling") for b in blocks], interquartile_mean),
        worst_settling=float(slowest.mean()),
        roughness=over_seeds([b.array("roughness") for b in blocks], interquartile_mean),
        energy=over_seeds([b.array("energy") for b in blocks], interquartile_mean),
        largest_q1=float(reached.max()) if reached.size else float("nan"),
        left_travel=sum(sum(b.left_travel) for b in blocks),
    )


def over_seeds(
    groups: Sequence[NDArray[np.float64]], statistic: Callable[[NDArray[np.float64]], NDArray[np.float64]]
) -> Interval:
    """A figure of all values, with a 95 % bootstrap interval that draws seeds first and their trials then."""
    groups = [g for g in groups if g.size]
    if not groups:
        return Interval(np.nan, np.nan, np.nan, 0)
    rng = np.random.default_rng(0)
    drawn = []
    for _ in range(RESAMPLES):
        some = [groups[i] for i in rng.integers(len(groups), size=len(groups))]
        drawn.append(float(statistic(np.concatenate([g[rng.integers(g.size, size=g.size)] for g in some]))))
    low, high = np.quantile(drawn, [0.025, 0.975])
    whole = np.concatenate(groups)
    return Interval(float(statistic(whole)), float(low), float(high), int(whole.size))


def over_seeds_rate(groups: Sequence[NDArray[np.float64]]) -> Interval:
    """A success rate; its interval is the wider of Wilson's over all trials and the one over seeds."""
    pooled, spread = success_rate(np.concatenate(groups)), over_seeds(groups, lambda x: x.mean(axis=-1))
    return Interval(pooled.value, min(pooled.low, spread.low), max(pooled.high, spread.high), pooled.n)


def as_json(cell: Cell) -> dict:
    """A cell for a file."""
    number = lambda x: None if isinstance(x, float) and np.isnan(x) else x  # noqa: E731  (JSON has no NaN)
    return {
        name: x.to_dict() if isinstance(x, Interval) else list(x) if isinstance(x, tuple) else number(x)
        for name, x in vars(cell).items()
    }
