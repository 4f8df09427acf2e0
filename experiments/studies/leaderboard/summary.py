"""Figures over trials and training seeds, with intervals that know of both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from controllers.comparison.statistics import Interval, interquartile_mean, over_seeds, over_seeds_rate

from .blocks import Block

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


def as_json(cell: Cell) -> dict:
    """A cell for a file."""
    number = lambda x: None if isinstance(x, float) and np.isnan(x) else x  # noqa: E731  (JSON has no NaN)
    return {
        name: x.to_dict() if isinstance(x, Interval) else list(x) if isinstance(x, tuple) else number(x)
        for name, x in vars(cell).items()
    }
