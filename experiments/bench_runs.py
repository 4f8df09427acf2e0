"""Controllers on the bench's rigs: seeded runs from near upright or hanging, their cost, and what differs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from controllers.comparison.statistics import Interval, success_rate, typical
from controllers.comparison.trials import HOLD, UPRIGHT
from experiments.bench import Laboratory, Rig
from experiments.bench.recording import BENCH_FALLEN
from furuta_gym.simulation import check_clock

WOUND = 2 * np.pi  # rad of the arm
START = (0.5, 0.1)  # rad; half-widths of the uniform starts, arm and pendulum
FIGURES = ("rms_q1", "rms_q2", "energy")
SWING_UP_FIGURES = ("settling", "rms_q2", "energy")
SWING_UP = 15.0  # s of a swing-up


@dataclass(frozen=True)
class Run:
    """One run. rms angles [rad] of the true motion (swing-up: of the last 5 s), energy ∫u² dt, settling [s]: when a
    swing-up came upright to stay. NaN where the rig was lost or the swing-up failed."""

    seed: int
    success: bool
    rms_q1: float
    rms_q2: float
    energy: float
    settling: float = np.nan


def run_on_bench(rig: Rig, policy: Any, seed: int, duration: float) -> Run:
    """Let `policy` (readings in, command out) balance the rig; start and noise follow from the seed."""
    angles, commands = _played(rig, policy, seed, duration, 0.0, BENCH_FALLEN)
    if len(angles) < len(commands):
        return Run(seed, False, np.nan, np.nan, np.nan)
    rms = np.sqrt(np.mean(angles**2, axis=0))
    return Run(seed, True, float(rms[0]), float(rms[1]), float(np.sum(commands**2) * rig.period))


def swing_up_on_bench(rig: Rig, policy: Any, seed: int, duration: float = SWING_UP, hold: float = HOLD) -> Run:
    """Let `policy` swing the rig up from hanging. It succeeds if the last `hold` seconds are within 0.2 rad of upright
    and the arm never turned further than 2π; start and noise follow from the seed."""
    angles, commands = _played(rig, policy, seed, duration, np.pi, np.inf)
    if len(angles) < len(commands):
        return Run(seed, False, np.nan, np.nan, np.nan)
    lean = np.abs(angles[:, 1] - 2 * np.pi * np.round(angles[:, 1] / (2 * np.pi)))
    last = round(hold / rig.period)
    if (lean[-last:] >= UPRIGHT).any():
        return Run(seed, False, np.nan, np.nan, np.nan)
    away = np.flatnonzero(lean >= UPRIGHT)
    q1, q2 = np.sqrt(np.mean(angles[-last:, 0] ** 2)), np.sqrt(np.mean(lean[-last:] ** 2))
    settling = (away[-1] + 1) * rig.period if away.size else 0.0
    return Run(seed, True, float(q1), float(q2), float(np.sum(commands**2) * rig.period), settling)


def _played(
    rig: Rig, policy: Any, seed: int, duration: float, around: float, fallen: float
) -> tuple[np.ndarray, np.ndarray]:
    """True angles (k, 2) [rad], shorter where the rig was lost, and commands (n,) from a start near q2 = `around`."""
    lab = Laboratory(rig, seed)
    check_clock(policy, lab.period)
    offset = np.random.default_rng([seed, 0x57A]).uniform(-1, 1, 2) * START
    y = lab.reset(q=(offset[0], around + offset[1]))
    policy.reset()
    n = round(duration / lab.period)
    angles, commands = np.empty((n, 2)), np.empty(n)
    for k in range(n):
        commands[k] = min(max(float(policy(y)), -lab.u_max), lab.u_max)
        y = lab.step(commands[k])
        angles[k] = lab.state[:2]
        if not (abs(angles[k, 0]) <= WOUND and abs(angles[k, 1]) <= fallen):
            return angles[:k], commands
    return angles, commands


def summary(runs: Sequence[Run], figures: Sequence[str] = FIGURES) -> dict[str, Interval]:
    """Success rate, and the other figures over the successful runs, with 95 % intervals."""
    table = {name: np.array([asdict(run)[name] for run in runs], dtype=float) for name in figures}
    won = np.array([run.success for run in runs])
    return {"success": success_rate(won)} | {name: typical(values[won]) for name, values in table.items()}


@dataclass(frozen=True)
class Contrast:
    """After against before, run by run. ratios[figure]: after/before where both runs succeeded (below 1: less)."""

    before: Interval
    after: Interval
    ratios: Mapping[str, Interval]

    @property
    def verdict(self) -> str:
        """What 95 % intervals allow to say: success first, then every figure whose ratio keeps clear of one."""
        if self.after.low > self.before.high:
            return "better: it holds now"
        if self.after.high < self.before.low:
            return "worse: it falls now"
        changed = [
            f"{name} {100 * (ratio.value - 1):+.0f} %"
            for name, ratio in self.ratios.items()
            if ratio.high < 1 or ratio.low > 1
        ]
        return ", ".join(changed) or "no difference shown"


FEWEST_PAIRS = 6
"""Pairs of runs below which a bootstrap's interval is too short to say anything by."""


def contrast(before: Sequence[Run], after: Sequence[Run], figures: Sequence[str] = FIGURES) -> Contrast:
    """Compare runs that met the same seeds in the same order. Raises ValueError otherwise."""
    if [run.seed for run in before] != [run.seed for run in after]:
        raise ValueError("runs can be compared one by one only if they met the same seeds")
    both = [(asdict(b), asdict(a)) for b, a in zip(before, after, strict=True) if a.success and b.success]
    ratios = {}
    for name in figures:
        log = typical([np.log(a[name] / b[name]) for b, a in both])
        if log.n < FEWEST_PAIRS:
            log = Interval(log.value, np.nan, np.nan, log.n)
        ratios[name] = Interval(float(np.exp(log.value)), float(np.exp(log.low)), float(np.exp(log.high)), log.n)
    wins = [success_rate([run.success for run in runs]) for runs in (before, after)]
    return Contrast(wins[0], wins[1], ratios)
