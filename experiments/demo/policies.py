"""The last step of the demo: policies learned without and with the effect, and LQRs, on the bench rig that hides it."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from controllers import make_controller
from controllers.comparison.statistics import Interval
from controllers.training.train import Training, train
from experiments.bench import Rig
from experiments.bench_runs import Run, contrast, run_on_bench, summary
from furuta_gym.plant import Plant

Tell = Callable[[str], None]
Work = Callable[[str], AbstractContextManager[Tell]]
"""What is entered for each long work, with its name; it gives what is told how far the work is."""

STEPS = 400_000  # of the environment: about ten seconds of CPU on one core
RUNS, DURATION = 10, 6.0
SEED = 2000  # of the first run; not a seed of the logs
SIDES = ("without", "with")


@contextmanager
def quietly(text: str) -> Iterator[Tell]:
    """Work that shows nothing."""
    yield lambda more: None


def in_tenths(tell: Tell) -> Callable[[int, int], None]:
    """Progress in counts, told in percent, each tenth once."""
    shown = 0

    def count(done: int, of: int) -> None:
        nonlocal shown
        if (percent := min(10 * (10 * done // of), 100)) > shown:  # it goes up to whole batches
            tell(f"{percent} %")
            shown = percent

    return count


@dataclass(frozen=True)
class Played:
    """A controller on the rig. side: the plant it was made from, "without" or "with" the effect."""

    name: str
    side: str
    runs: tuple[Run, ...]

    @property
    def figures(self) -> dict[str, Interval]:
        """Success rate, and rms angles [rad] and ∫u² dt of the runs that held, with 95 % intervals."""
        return summary(self.runs)


@dataclass(frozen=True)
class Trial:
    """All that was played. training: seconds on the clock and of CPU that each policy took to learn; steps: of each;
    unit: of the command."""

    played: tuple[Played, ...]
    training: dict[str, dict[str, float]]
    steps: int
    unit: str

    @property
    def head(self) -> tuple[str, ...]:
        """Of the table of `rows`."""
        return ("controller", "held", "rms q1 [rad]", "rms q2 [rad]", f"∫u² dt [({self.unit})² s]")

    @property
    def rows(self) -> list[tuple[str, ...]]:
        """A controller in each, with 95 % intervals."""
        return [
            (
                f"{p.name}, made {p.side} the effect",
                f"{100 * p.figures['success'].value:.0f} %",
                *(_interval(p.figures[name]) for name in ("rms_q1", "rms_q2", "energy")),
            )
            for p in self.played
        ]

    def verdict(self, name: str) -> str:
        """What the runs allow to say of a controller made with the effect against one made without."""
        without, with_it = (next(p for p in self.played if (p.name, p.side) == (name, side)) for side in SIDES)
        return contrast(without.runs, with_it.runs).verdict.replace("rms_", "rms ").replace("energy", "∫u² dt")

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(p.name for p in self.played))

    def to_dict(self) -> dict[str, Any]:
        """For machines."""
        rows = [
            {"controller": p.name, "made": p.side} | {k: interval.to_dict() for k, interval in p.figures.items()}
            for p in self.played
        ]
        return {
            "runs": RUNS,
            "duration_s": DURATION,
            "steps": self.steps,
            "rows": rows,
            "with_against_without": {name: self.verdict(name) for name in self.names},
            "training": self.training,
        }


def try_on_rig(
    without: Plant,
    with_it: Plant,
    rig: Rig,
    folder: Path,
    seed: int,
    say: Callable[[str], None],
    steps: int = STEPS,
    work: Work = quietly,
) -> Trial:
    """Train a policy on each plant, and let it and an LQR balance the rig itself from the same starts.

    The policies, three readings and the last command deep so that they can see a delay, are kept in `folder`. work: see
    `quietly`. Raises ValueError without the extra "rl".
    """
    known = {"u_max": rig.kind.u_max, "sample_time": rig.period}  # what a laboratory knows and a log does not tell
    played, spent = [], {}
    for side, plant in zip(SIDES, (without, with_it), strict=True):
        plant = plant.replace(**known)
        path = folder / f"policy_{side}.zip"
        path.unlink(missing_ok=True)
        wall, cpu = time.perf_counter(), time.process_time()
        with work(f"training on the plant {side} the effect") as tell:
            training = Training(plant, "balance", "ppo", steps, seed, history=3, observe_command=True)
            train(training, path, progress=in_tenths(tell))
        spent[side] = {"wall_s": round(time.perf_counter() - wall, 1), "cpu_s": round(time.process_time() - cpu, 1)}
        say(f"   trained on the plant {side} the effect: {steps:,} steps in {spent[side]['wall_s']:.0f} s")
        for name, source in (("lqr", "lqr"), ("policy", path)):
            controller = make_controller(source, plant, rig.period)
            with work(f"playing the {name} made {side} the effect on the rig"):
                runs = tuple(run_on_bench(rig, controller, SEED + i, DURATION) for i in range(RUNS))
            played.append(Played(name, side, runs))
    played.sort(key=lambda p: p.name)
    return Trial(tuple(played), spent, steps, without.unit)


def _interval(x: Interval) -> str:
    return f"{x.value:.3g} ({x.low:.3g} … {x.high:.3g})"
