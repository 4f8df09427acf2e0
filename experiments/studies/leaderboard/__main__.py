"""The leaderboard of swing-ups: `python -m experiments.studies.leaderboard`.

Designed, planned and learned controllers play the same rigs, which none of them knows. Every training and every block
of trials is a file below `--work`; what is there is not run again, so that the command can be stopped at any time.
Writes leaderboard.json, leaderboard.png and leaderboard_tables.md.
"""

from __future__ import annotations

import platform
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from controllers.comparison.conditions import Condition
from experiments.cli.errors import explained
from experiments.cli.output import check_folder, counted, errors, write_json
from experiments.workers import BACKENDS
from furuta_gym.files import write_whole
from furuta_gym.plant import Plant

from .blocks import Block, collected, run
from .contestants import Contestant, chosen
from .options import WORK, Backend, Jobs, PlantName, Trials, Work
from .page import cells_of, draw, spent_on, tables
from .rigs import DURATION, leaderboard_conditions
from .summary import as_json

SCHEMA = "furuta-leaderboard/1"


def main(
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for JSON, tables and picture.")] = Path(
        "out/leaderboard"
    ),
    work: Work = WORK,
    plant: PlantName = "qube",
    only: Annotated[str, typer.Option(help="Contestants, separated by commas; default: all.")] = "",
    seeds: Annotated[int, typer.Option(help="Trainings of each learned one.", min=1)] = 5,
    trials: Trials = 200,
    backend: Backend = "loky",
    jobs: Jobs = 1,
    page_only: Annotated[bool, typer.Option("--page-only", help="Run nothing; show what is there.")] = False,
) -> None:
    """Who swings up best on rigs that nobody told it of?"""
    with explained():
        contestants, rig = chosen(only), Plant.resolve(plant)
        if backend not in BACKENDS:
            raise ValueError(f"--backend {backend!r}: expected one of {', '.join(BACKENDS)}")
        check_folder(output)
        check_folder(work)
        conditions = leaderboard_conditions(rig, trials)
        if page_only:
            blocks = collected(contestants, seeds, rig, conditions, work)
        else:
            blocks = _run(contestants, seeds, rig, conditions, work, backend, jobs)
        cells = cells_of(contestants, conditions, blocks, DURATION)
        spent = spent_on(contestants, seeds, work)
        settings = {"plant": rig.to_dict(), "seeds": seeds, "trials": trials, "python": platform.python_version()}
        data = {"settings": settings, "spent": spent, "cells": [as_json(c) for c in cells]}
        write_json(output / "leaderboard.json", {"schema": SCHEMA} | data)
        text = tables(contestants, conditions, cells, spent, rig)
        write_whole(output / "leaderboard_tables.md", text)
        draw(contestants, conditions, cells, output / "leaderboard.png")
        typer.echo(text)


def _run(
    contestants: Sequence[Contestant],
    seeds: int,
    plant: Plant,
    conditions: Sequence[Condition],
    work: Path,
    backend: str,
    jobs: int,
) -> list[Block]:
    command = "python -m experiments.studies.leaderboard"
    try:
        with counted("trainings") as tell:
            return run(
                contestants,
                seeds,
                plant,
                conditions,
                work,
                command=command,
                backend=backend,
                jobs=jobs,
                tell=lambda stage, done, of: tell(done, of, stage),
            )
    except KeyboardInterrupt:
        errors.print("Stopped. The same command goes on from here.")
        raise typer.Exit(130) from None


if __name__ == "__main__":
    typer.run(main)
