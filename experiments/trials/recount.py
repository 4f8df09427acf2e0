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
    files: Annotated[list[Path], typer.Argument(help="Tables outcomes.csv of furuta trials, counted together.")],
    power: Annotated[
        Path | None, typer.Option(help="The outcomes.csv of furuta trials --power, for the power curves only.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="A folder for all files that furuta trials writes.")
    ] = None,
) -> None:
    """Print the tables of summary.md, counted from the outcomes of runs that were kept."""
    try:
        outcomes = [outcome for file in files for outcome in read_outcomes(file)]
        if len({outcome.id for outcome in outcomes}) < len(outcomes):
            raise ValueError("a trial stands in these files twice; give runs of other seeds")
        more = read_outcomes(power) if power else []
        if output:
            output.mkdir(parents=True, exist_ok=True)
            about = {
                "recounted": ", ".join(file.name for file in files),
                "answered": len(outcomes),
                "version": version("furuta-gym"),
            }
            write_report(output, outcomes, about, more)
    except (OSError, ValueError) as error:
        sys.exit(f"error: {error}")
    curves = power_curves([*outcomes, *more])
    typer.echo(f"{len(outcomes)} trials\n\n{markdown(summarize(outcomes), curves)}")


if __name__ == "__main__":
    typer.run(main)
