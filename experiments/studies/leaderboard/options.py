"""Options that the studies of swing-ups share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Work = Annotated[Path, typer.Option(help="Folder of trainings and trials; a run goes on there.")]
PlantName = Annotated[str, typer.Option("--plant", help="qube, large, table3 or a plant file.")]
Trials = Annotated[int, typer.Option(help="Of each rig and seed.", min=1)]
Backend = Annotated[str, typer.Option(help="loky, or dask (cluster at DASK_SCHEDULER_ADDRESS, or here).")]
Jobs = Annotated[int, typer.Option(help="Processes.", min=1)]

WORK = Path("out/leaderboard")
"""One folder for all, so that nothing is trained twice."""
