"""Count kept outcomes again, without asking anything: `python -m experiments.trials.recount outcomes.csv`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from .outcomes import read_outcomes
from .report import markdown
from .summary import power_curves, summarize


def main(file: Annotated[Path, typer.Argument(help="An outcomes.csv of furuta trials.")]) -> None:
    """Print the tables of summary.md, counted from the outcomes of a run that was kept."""
    try:
        outcomes = read_outcomes(file)
    except (OSError, ValueError) as error:
        sys.exit(f"error: {error}")
    typer.echo(f"{len(outcomes)} trials\n\n{markdown(summarize(outcomes), power_curves(outcomes))}")


if __name__ == "__main__":
    typer.run(main)
