"""`furuta identify`: logs in, plant file out."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from . import options as opt
from .output import busy, print_json


class Method(StrEnum):
    """As `identification.identify.METHODS`, which is too slow to import for --help."""

    prediction_error = "prediction-error"
    filtered_ls = "filtered-ls"
    recursive_ls = "recursive-ls"
    ekf = "ekf"


def identify_command(
    logs: opt.Logs,
    output: Annotated[Path, typer.Option("-o", "--output", help="Plant file to write (.json).")],
    method: Annotated[
        Method, typer.Option(help="filtered-ls is the paper's; recursive-ls and ekf run on line.")
    ] = Method.prediction_error,
    fix: Annotated[
        list[str] | None, typer.Option(help="Known parameters: theta4=0.012 (alone: the start plant's value).")
    ] = None,
    prior: Annotated[list[str] | None, typer.Option(help="Roughly known: theta2=0.012±0.001 (or +-).")] = None,
    physical: Annotated[
        bool, typer.Option("--physical", help="Keep to what a rigid arm and pendulum can have.")
    ] = False,
    start: Annotated[
        str | None, typer.Option(help="Plant to start from: table3, qube, large or a file; default: from the logs.")
    ] = None,
    columns: opt.Columns = None,
    unit: opt.Unit = None,
    pendulum_zero: opt.PendulumZero = None,
    flip: opt.Flip = None,
    encoder_counts: opt.EncoderCounts = None,
    input_unit: opt.InputUnit = None,
    as_json: opt.AsJson = False,
) -> None:
    """Estimate θ1 … θ9 and r, with uncertainty, from logs of one rig (several are fitted jointly)."""
    opt.output_file(output, [".json"], logs)
    fixed, priors = opt.fixed_values(fix), opt.prior_values(prior)
    if method is not Method.prediction_error and (fixed or priors or physical):
        raise ValueError(f"--fix, --prior and --physical work with --method prediction-error, not with {method}")
    from furuta_gym.plant import Plant
    from identification.logs import read_logs

    if start is not None:
        Plant.resolve(start)  # a wrong name is told before the logs are read

    read = read_logs(logs, **opt.mapping(columns, unit, pendulum_zero, flip, encoder_counts, input_unit))
    from identification.identify import identify

    if not as_json:
        for log in read:
            typer.echo(str(log))
    with busy("fitting …"):
        estimate = identify(read, start, str(method), fixed=fixed, priors=priors, physical=physical)
    estimate.save(output)
    if as_json:
        print_json(estimate.to_dict() | {"plant": str(output)})
        return
    typer.echo(str(estimate))
    typer.echo(f"Written: {output}")
    typer.echo(f"Next: furuta validate {output} LOG   (a log that was not fitted, with the same mapping options)")
