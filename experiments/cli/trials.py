"""`furuta trials`: blind trials of the diagnosis on rigs of the bench."""

from __future__ import annotations

import os
from importlib.metadata import version
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from . import options as opt
from .output import check_folder, counted, errors, print_json


def trials_command(
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder; a run that was stopped there goes on.")],
    effects: Annotated[
        str,
        typer.Option(
            help="Of the library's effects, hide only these, separated by commas; default: all. The kinds outside and "
            "absorbed hide others all the same: leave them out with --kinds."
        ),
    ] = "",
    rigs: Annotated[
        str, typer.Option(help="Only rigs of these sets of the bench: table3, servo, workshop, desk.")
    ] = "",
    kinds: Annotated[
        str,
        typer.Option(
            help="Only these: library, strong, none, torque_noise, absorbed, rounding, hard, outside, two, composite."
        ),
    ] = "",
    seeds: Annotated[int, typer.Option(help="Trials for each effect and rig; other kinds in proportion.")] = 5,
    split: Annotated[
        str, typer.Option(help="dev to develop on, final to publish. They share no seed and no rig.")
    ] = "dev",
    share: Annotated[float, typer.Option(help="This part of the plan, taken evenly.")] = 1.0,
    power: Annotated[
        bool, typer.Option("--power", help="Effects alone, from invisible to plain, for the power curves.")
    ] = False,
    seed: Annotated[int, typer.Option(help="Use another seed for a new set of test rigs.")] = 0,
    backend: Annotated[str, typer.Option(help="loky, or dask (cluster at DASK_SCHEDULER_ADDRESS, or here).")] = "loky",
    jobs: Annotated[int, typer.Option(help="Processes; default: one for each core.", min=1)] = os.cpu_count() or 1,
    as_json: opt.AsJson = False,
) -> None:
    """Hide effects in virtual rigs, have their logs diagnosed blind, and count what was right.

    Stop it at any time (Ctrl-C): it reports on what was answered, and the same command goes on from there.
    """
    from experiments.report import require_extra
    from experiments.trials.plan import make_plan
    from experiments.trials.report import FILES, headline, write_report
    from experiments.trials.run import read_results, read_unanswerable, run_trials
    from experiments.trials.scoring import score

    from .whole import whole_folder

    require_extra()
    check_folder(output)
    plan = make_plan(split, seeds, opt.names(effects), opt.names(rigs), opt.names(kinds), share, power, seed)
    if not plan:
        raise ValueError("no trial is left by --effects, --kinds and --rigs; expected at least one")
    stopped = False
    try:
        with counted("trials") as tell:
            run_trials(
                plan,
                output,
                backend,
                jobs,
                progress=lambda stage, done, of: tell(done, of, stage),
            )
    except KeyboardInterrupt:
        stopped = True
        errors.print("Stopped. The same command goes on from here.")
    outcomes = [score(sealed, answer) for sealed, answer in read_results(plan, output)]
    with whole_folder(output, FILES) as folder:
        summary = write_report(
            folder,
            outcomes,
            {
                "split": split,
                "seeds": seeds,
                "share": share,
                "power": power,
                "seed": seed,
                "planned": len(plan),
                "answered": len(outcomes),
                "pendulum_lost": len(read_unanswerable(plan, output)),
                "version": version("furuta-gym"),
            },
        )
    if as_json:
        print_json(summary)
    else:
        table = Table("question", "answer (95 % interval)", title=f"{len(outcomes)} of {len(plan)} trials answered")
        for row in headline(summary):
            table.add_row(*row)
        Console(width=None if Console().is_terminal else 120).print(table)
        typer.echo(f"Written in {output}: {', '.join(FILES)}")
    if stopped:
        raise typer.Exit(130)
