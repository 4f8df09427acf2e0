"""Count kept outcomes again, without asking anything: `python -m experiments.trials.recount outcomes.csv`."""

from __future__ import annotations

import sys
from importlib.metadata import version
from pathlib import Path
from typing import Annotated

import typer

from .outcomes import read_outcomes
from .report import markdown, write_report
from .summary import power_curves, summarize


def main(
    file: Annotated[Path, typer.Argument(help="An outcomes.csv of furuta trials.")],
    power: Annotated[
        Path | None, typer.Option(help="The outcomes.csv of furuta trials --power, for the power curves only.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="A folder for all files that furuta trials writes.")
    ] = None,
) -> None:
    """Print the tables of summary.md, counted from the outcomes of a run that was kept."""
    try:
        outcomes = read_outcomes(file)
        more = read_outcomes(power) if power else []
        if output:
            output.mkdir(parents=True, exist_ok=True)
            about = {"recounted": file.name, "answered": len(outcomes), "version": version("furuta-gym")}
            write_report(output, outcomes, about, more)
    except (OSError, ValueError) as error:
        sys.exit(f"error: {error}")
    curves = power_curves([*outcomes, *more])
    typer.echo(f"{len(outcomes)} trials\n\n{markdown(summarize(outcomes), curves)}")


if __name__ == "__main__":
    typer.run(main)
