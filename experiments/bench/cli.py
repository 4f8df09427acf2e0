"""`furuta bench list` and `furuta bench record`."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from .effects import catalogue
from .named import list_rigs, rig
from .programme import EXPERIMENTS
from .recording import PendulumLost
from .recording import record as run_experiment
from .rigs import HiddenEffect, Rig
from .sets import SETS
from .size import effect_size

app = typer.Typer(
    help="The virtual bench: rigs that may hide something, simulated by code that shares nothing with the plant model.",
    no_args_is_help=True,
)


def _refuse(message: str) -> typer.Exit:
    typer.echo(f"Error: {message}", err=True)
    return typer.Exit(2)


@app.command("list")
def list_command(
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")] = False,
) -> None:
    """Show the rigs and the experiments. What a rig hides is not shown: record a log and find out."""
    rigs = [rig(name) for name in list_rigs()]
    if as_json:
        facts = {
            "rigs": [
                {
                    "name": r.name,
                    "input_unit": r.kind.unit,
                    "u_max": r.kind.u_max,
                    "encoder_counts": list(r.counts),
                    "sample_time": r.period,
                }
                for r in rigs
            ],
            "experiments": [{"name": e.name, "says": e.says, "duration": e.duration} for e in EXPERIMENTS.values()],
        }
        typer.echo(json.dumps(facts, ensure_ascii=False, indent=2))
        return
    table = Table("rig", "command", "limit", "encoder counts", "sample time", title="Rigs")
    for r in rigs:
        counts = " / ".join(str(c) for c in r.counts)
        table.add_row(r.name, r.kind.unit, f"±{r.kind.u_max:g} {r.kind.unit}", counts, f"{1000 * r.period:g} ms")
    menu = Table("experiment", "what", "duration", title="Experiments")
    for e in EXPERIMENTS.values():
        menu.add_row(e.name, e.says, f"{e.duration:g} s")
    console = Console()
    console.print(table)
    console.print(menu)


@app.command("record")
def record_command(
    rig_name: Annotated[str, typer.Option("--rig", help="A rig of `furuta bench list`.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Log file to write (CSV).")],
    experiment: Annotated[str, typer.Option(help="An experiment of `furuta bench list`.")] = "paper",
    seed: Annotated[int, typer.Option(help="Everything random follows from it.", min=0)] = 0,
    duration: Annotated[float | None, typer.Option(help="Length in seconds; default: the experiment's.")] = None,
    sample_time: Annotated[float | None, typer.Option(help="Sample time in seconds; default: the rig's.")] = None,
    reveal: Annotated[
        bool, typer.Option("--reveal", help="Print what the rig hides, and write it beside the log as .truth.json.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print what was written as JSON.")] = False,
) -> None:
    """Run one experiment on a rig and write its log: t, q1, q2, u, as the rig's computer saw them."""
    try:
        if output.suffix.lower() != ".csv":
            raise ValueError(f"{output} given, expected a name that ends in .csv.")
        run = run_experiment(rig_name, experiment, seed, duration, sample_time)
        output.parent.mkdir(parents=True, exist_ok=True)
        run.write(output)
        if reveal:
            run.write_truth(output.with_suffix(".truth.json"))
    except (ValueError, PendulumLost) as error:
        raise _refuse(str(error)) from error
    except OSError as error:
        raise _refuse(f"output {output}: nothing can be written there ({error.strerror})") from error
    if as_json:
        facts = {"log": str(output), "samples": len(run.t), "duration": float(run.t[-1])}
        typer.echo(json.dumps(facts | ({"truth": run.truth} if reveal else {}), ensure_ascii=False, indent=2))
        return
    typer.echo(f"{output}: {len(run.t)} samples over {run.t[-1]:.2f} s of {run.rig.name}, experiment {experiment}.")
    if reveal:
        typer.echo(json.dumps(run.truth, ensure_ascii=False, indent=2))
    else:
        typer.echo(f"Next: furuta diagnose {shlex.quote(str(output))} -o diagnosis")


@app.command("size")
def size_command(
    effect: Annotated[
        list[str] | None, typer.Option(help="An effect; may be given several times. Default: all.")
    ] = None,
    kind: Annotated[list[str] | None, typer.Option("--set", help="A parameter set. Default: all.")] = None,
    strength: Annotated[float, typer.Option(help="Its strength; 1 is plain to see.", min=0.0)] = 1.0,
    form: Annotated[str, typer.Option(help="table or bench; default: the first that the effect has.")] = "",
    experiment: Annotated[str, typer.Option(help="An experiment of `furuta bench list`.")] = "paper",
    seed: Annotated[int, typer.Option(help="Seed of the experiment.", min=0)] = 0,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of a table.")] = False,
) -> None:
    """Show how visible effects are: the error-to-noise ratio √(1 + (e/σ)²) of each, on an experiment.

    e is the error of model (5) after refitting θ, σ the encoders' noise. 1.00 is invisible. A pendulum that falls
    shows as "lost".
    """
    sizes: dict[str, dict[str, float | None]] = {}
    try:
        rigs = {
            (name, s): Rig(s, [HiddenEffect(name, strength, form)])
            for name in effect or catalogue()
            for s in kind or SETS
        }
        with Progress(console=Console(stderr=True), transient=True) as progress:
            for (name, s), hidden in progress.track(rigs.items(), description="Measuring"):
                try:
                    ratio: float | None = effect_size(hidden, experiment, seed).ratio
                except PendulumLost:
                    ratio = None
                sizes.setdefault(name, {})[s] = ratio
    except ValueError as error:
        raise _refuse(str(error)) from error
    if as_json:
        typer.echo(json.dumps(sizes, indent=2))
        return
    columns = list(next(iter(sizes.values())))
    table = Table("effect", *columns, title=f"Error-to-noise ratio, strength {strength:g}, experiment {experiment}")
    for name, row in sizes.items():
        table.add_row(name, *("lost" if r is None else f"{r:.2f}" for r in row.values()))
    Console().print(table)
