"""One learned policy for rigs that differ: `python -m experiments.studies.robust_policy`.

Trains the recipe `robust` with five seeds and plays each on rigs that are late, differ in their parts or pull at a
cable. Trainings and trials are files below `--work`, shared with the leaderboard; what is there is not run again.
Writes robust_policy.json and robust_policy_tables.md, which says what is missed.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from experiments.cli.errors import explained
from experiments.cli.output import check_folder, counted, errors, write_json
from experiments.studies.leaderboard.blocks import Block, run
from experiments.studies.leaderboard.contestants import chosen
from experiments.studies.leaderboard.options import WORK, Backend, Jobs, PlantName, Trials, Work
from experiments.studies.leaderboard.page import spent_on
from experiments.studies.leaderboard.rigs import DURATION, robust_conditions
from experiments.studies.leaderboard.summary import Cell, as_json, cell
from furuta_gym.files import write_whole
from furuta_gym.plant import Plant

SCHEMA = "furuta-robust-policy/1"
MOST_CPU = 600.0  # s of a training; two cores have twice that in ten minutes
LATE, BUILT, CABLE = 0.95, 0.80, 0.95  # success that is asked of each seed
CALM = 20.0  # {u}/s of roughness, 16 ms late
SOON = 1.0  # s until upright


def misses(cells: Sequence[Cell], spent: Sequence[float]) -> list[str]:
    """What was asked for and is not reached, a sentence each; success is that of the worst seed."""
    found = []
    for c in cells:
        least = LATE if c.condition.endswith("ms late") and "built" not in c.condition else BUILT
        least = CABLE if c.condition.startswith("cable") else least
        if min(c.each) < least:
            rate = f"{100 * min(c.each):.1f} %, asked for are {100 * least:.0f} %"
            found.append(f"{c.condition}: the worst seed has {rate}.")
        if c.left_travel:
            found.append(f"{c.condition}: the arm leaves its travel in {c.left_travel} of {c.trials} trials.")
        if c.condition.startswith("16 ms") and not c.roughness.value <= CALM:
            found.append(f"{c.condition}: the roughness is {c.roughness.value:.1f}, asked for are {CALM:.0f}.")
        if not c.settling.value < SOON:
            found.append(f"{c.condition}: upright after {c.settling.value:.2f} s, asked for is less than {SOON:g} s.")
    if max(spent, default=0.0) > MOST_CPU:
        found.append(f"The longest training took {max(spent):.0f} s of CPU, asked for are {MOST_CPU:.0f} s at most.")
    return found


def report(cells: Sequence[Cell], spent: Sequence[float], unit: str) -> str:
    """Markdown: a row for each rig, and what is missed."""
    head = (
        f"| rig | success [%] | worst seed [%] | up after [s] (worst 5 %) | roughness [{unit}/s] "
        "| largest arm angle [rad] | arm out of travel |"
    )
    lines = [head, "|---" * 7 + "|"]
    for c in cells:
        s = c.success
        lines.append(
            f"| {c.condition} | {100 * s.value:.4g} ({100 * s.low:.1f}–{100 * s.high:.1f}) | {100 * min(c.each):.4g} "
            f"| {c.settling.value:.2f} ({c.worst_settling:.2f}) | {c.roughness.value:.1f} | {c.largest_q1:.1f} "
            f"| {c.left_travel} of {c.trials} |"
        )
    shown = ", ".join(f"{x:.0f}" for x in spent)
    lines += ["", f"CPU of the trainings: {shown} s.", "", "Missed:", ""]
    missed = misses(cells, spent)
    return "\n".join([*lines, *(f"- {text}" for text in missed), *([] if missed else ["- nothing."])]) + "\n"


def cells_by_rig(blocks: Sequence[Block]) -> list[Cell]:
    """One cell for each rig, over all seeds."""
    names = list(dict.fromkeys(b.condition for b in blocks))
    return [cell([b for b in blocks if b.condition == name], DURATION) for name in names]


def main(
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for JSON and table.")] = Path(
        "out/robust_policy"
    ),
    work: Work = WORK,
    plant: PlantName = "qube",
    seeds: Annotated[int, typer.Option(help="Trainings.", min=1)] = 5,
    trials: Trials = 200,
    backend: Backend = "loky",
    jobs: Jobs = 1,
) -> None:
    """Does one policy swing up rigs with input delay, parameter differences and a cable that pulls the arm?"""
    with explained():
        rig = Plant.resolve(plant)
        check_folder(output)
        robust = chosen("ppo-robust")
        try:
            with counted("trainings") as tell:
                blocks = run(
                    robust,
                    seeds,
                    rig,
                    robust_conditions(rig, trials),
                    work,
                    command="python -m experiments.studies.robust_policy",
                    backend=backend,
                    jobs=jobs,
                    tell=lambda stage, done, of: tell(done, of, stage),
                )
        except KeyboardInterrupt:
            errors.print("Stopped. The same command goes on from here.")
            raise typer.Exit(130) from None
        spent = spent_on(robust, seeds, work).get("ppo-robust", {"cpu_s": []})["cpu_s"]
        cells = cells_by_rig(blocks)
        found = {"spent_cpu_s": spent, "cells": [as_json(c) for c in cells], "missed": misses(cells, spent)}
        about = {"plant": rig.to_dict(), "seeds": seeds, "trials": trials}
        write_json(output / "robust_policy.json", {"schema": SCHEMA} | about | found)
        text = report(cells, np.round(spent, 1).tolist(), rig.unit)
        write_whole(output / "robust_policy_tables.md", text)
        typer.echo(text)


if __name__ == "__main__":
    typer.run(main)
