"""Where do the designed and the planned swing-up work? `python -m experiments.studies.swing_up_table qube rig.json`.

For every plant, delay of the command and u_max of the table both are designed on the plant with that delay and u_max,
and played on it: the designed one (`swing-up`), and the planned one (`planned`, extra `plan`), which says whether the
optimiser finds a swing-up at all, and how fast. Writes swing_up_table.json and swing_up_table.md; prints the latter.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import typer
from scipy.stats import binomtest

from controllers import make_controller
from controllers.base import DesignError
from controllers.comparison.conditions import Condition
from controllers.comparison.statistics import Interval, typical, worst
from controllers.design import choose_sample_time, choose_sensors
from controllers.swing_up.planning import plan_swing_up
from experiments.cli.errors import explained
from experiments.cli.output import counted, write_json
from furuta_gym.files import write_whole
from furuta_gym.plant import Effect, Plant

SCHEMA = "furuta-swing-up-table/1"
NAMES = ("swing-up", "planned")
ENOUGH = 0.95  # of the trials
SEED = 50_000


@dataclass(frozen=True)
class Size:
    """trials of each cell, delays [ms], largest commands [{u}]; duration [s] of a trial."""

    trials: int = 200
    delays: tuple[float, ...] = (0.0, 4.0, 8.0, 12.0, 16.0)
    largest: tuple[float, ...] = (4.0, 6.0, 10.0)
    duration: float = 15.0

    @classmethod
    def quick(cls) -> Size:
        """Small enough for a test: the two hardest corners."""
        return cls(trials=20, delays=(16.0,), largest=(4.0,), duration=11.0)


@dataclass(frozen=True)
class Played:
    """A controller in a cell. success: exact interval (Clopper–Pearson). Over the trials that succeeded: time until
    upright [s] and its worst 5 %, largest arm angle of all [rad], effort ∫u² dt [{u}² s] and roughness [{u}/s]."""

    success: Interval
    settling: Interval
    worst_settling: Interval
    largest_q1: float
    energy: Interval
    roughness: Interval


@dataclass(frozen=True)
class Cell:
    """Plant `name` with a delay [ms] and u_max [{u}]; plan: (time [s], effort [{u}² s]) or why there is none."""

    name: str
    delay: float
    u_max: float
    plan: tuple[float, float] | str
    played: dict[str, Played]


def cell(name: str, plant: Plant, delay: float, u_max: float, size: Size) -> Cell:
    """Design and play both in one cell; who cannot be designed is left out."""
    rig = plant.replace(u_max=u_max)
    if delay > 0:
        rig = rig.with_effects(Effect("input_delay", {"d": 1e-3 * delay}))
    T, sensors = choose_sample_time(rig, None), choose_sensors(rig, None)
    condition = Condition("swing-up", "swing_up", "swing_up", rig, sensors, size.trials, size.duration)
    played = {}
    for kind in NAMES:
        try:
            policy = make_controller(kind, rig, T, sensors)
        except DesignError:
            continue
        played[kind] = play(condition, policy, T)
    return Cell(name, delay, u_max, _plan(rig), played)


def play(condition: Condition, policy: Any, sample_time: float) -> Played:
    """All trials of a condition with a policy."""
    outcome = condition.play(policy, condition.starts(SEED), sample_time, SEED)
    up = outcome.success
    low, high = binomtest(int(up.sum()), up.size).proportion_ci(method="exact")
    return Played(
        success=Interval(float(up.mean()), float(low), float(high), up.size),
        settling=typical(outcome.settling[up]),
        worst_settling=worst(outcome.settling[up]),
        largest_q1=float(outcome.largest_q1.max()),
        energy=typical(outcome.energy[up]),
        roughness=typical(outcome.roughness[up]),
    )


def _plan(plant: Plant) -> tuple[float, float] | str:
    try:
        plan = plan_swing_up(plant.without("input_delay"))
    except DesignError as error:
        return str(error)
    return plan.duration, plan.effort


def run(plants: Sequence[str], size: Size, done: Callable[[int, int], None] | None = None) -> list[Cell]:
    """All cells, plant by plant. Raises ValueError for a plant that is none, before anything is played."""
    rigs = {Path(name).stem: Plant.resolve(name) for name in plants}
    if len(rigs) < len(plants):
        raise ValueError(f"the plants must have different names, got {', '.join(plants)}")
    places = [(name, u, d) for name in rigs for u in size.largest for d in size.delays]
    cells = []
    for name, u, d in places:
        cells.append(cell(name, rigs[name], d, u, size))
        if done:
            done(len(cells), len(places))
    return cells


def missed(cells: Sequence[Cell]) -> list[Cell]:
    """Where the designed swing-up stays below 95 % although there is a plan."""
    rate = lambda c: c.played["swing-up"].success.value if "swing-up" in c.played else 0.0  # noqa: E731
    return [c for c in cells if not isinstance(c.plan, str) and rate(c) < ENOUGH]


def report(cells: Sequence[Cell]) -> str:
    """Markdown: one row a cell."""
    head = (
        "| plant | u_max | delay [ms] | plan: time [s], effort | planned, played | up after | designed, played "
        "| up after [s] (worst 5 %) | largest arm angle [rad] | effort |"
    )
    lines = [head, "|---" * 10 + "|"]
    for c in cells:
        plan = c.plan if isinstance(c.plan, str) else f"{c.plan[0]:.2f}, {c.plan[1]:.0f}"
        row = [c.name, f"{c.u_max:g}", f"{c.delay:g}", plan]
        followed, designed = (c.played.get(name) for name in NAMES[::-1])
        row += [_rate(followed), f"{followed.settling.value:.2f}" if followed else "–", _rate(designed)]
        if designed:
            row += [f"{designed.settling.value:.2f} ({designed.worst_settling.value:.2f})"]
            row += [f"{designed.largest_q1:.1f}", f"{designed.energy.value:.0f}"]
        lines.append("| " + " | ".join(row + ["–"] * (10 - len(row))) + " |")
    left = missed(cells)
    possible = sum(not isinstance(c.plan, str) for c in cells)
    summary = f"A plan exists in {possible} of {len(cells)} cells. "
    summary += f"The designed swing-up stays below 95 % in {len(left)} of these."
    lines += ["", summary]
    return "\n".join(lines) + "\n"


def _rate(played: Played | None) -> str:
    if played is None:
        return "–"
    s = played.success
    return f"{100 * s.value:.4g} % ({100 * s.low:.1f}–{100 * s.high:.1f})"


def to_json(cells: Sequence[Cell], size: Size) -> dict[str, Any]:
    """The same for machines."""
    rows = []
    for c in cells:
        figures = {
            name: {key: x.to_dict() if isinstance(x, Interval) else x for key, x in vars(played).items()}
            for name, played in c.played.items()
        }
        plan = {"none": c.plan} if isinstance(c.plan, str) else {"time": c.plan[0], "effort": c.plan[1]}
        rows.append({"plant": c.name, "delay": 1e-3 * c.delay, "u_max": c.u_max, "plan": plan, "played": figures})
    return {"schema": SCHEMA, "size": asdict(size), "seed": SEED, "cells": rows}


def main(
    plants: Annotated[list[str], typer.Argument(help="qube, large, table3 or plant files; θ in volts here.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder to write to.")] = Path("out/swing_up_table"),
    quick: Annotated[bool, typer.Option("--quick", help="20 trials in the hardest cell.")] = False,
) -> None:
    """Success, time and effort of the designed and the planned swing-up over delay and supply."""
    began = time.perf_counter()
    with explained():
        size = Size.quick() if quick else Size()
        with counted("cells") as tell:
            cells = run(plants, size, tell)
        text = report(cells)
        write_json(output / "swing_up_table.json", to_json(cells, size))
        write_whole(output / "swing_up_table.md", text)
        typer.echo(text)
        typer.echo(f"{time.perf_counter() - began:.0f} s. Written in {output}", err=True)


if __name__ == "__main__":
    typer.run(main)
