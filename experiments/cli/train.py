"""`furuta train`: a policy learned on a plant, with the record of how."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from . import options as opt
from .output import counted, print_json


def train_command(
    plant: Annotated[str, typer.Option(help="table3, qube, large, or a plant file.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Policy to write, *.zip; its record goes beside it.")],
    ranges: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[NAME=RANGE]...",
            help="After --randomize: what to draw, such as input_delay=uniform:0,0.03 theta=physical:0.2.",
        ),
    ] = None,
    task: Annotated[str, typer.Option(help="balance, or swing_up (swing up and hold).")] = "balance",
    algo: Annotated[str, typer.Option(help="ppo, sac or tqc.")] = "ppo",
    steps: Annotated[int, typer.Option(help="Env steps in all.", min=1)] = 2_000_000,
    randomize: Annotated[
        bool,
        typer.Option("--randomize", help="Another rig for each episode: NAME=RANGE …, else θ from its covariance."),
    ] = False,
    effect_chance: Annotated[
        list[str] | None,
        typer.Option(help="NAME=p lets an effect act in an episode with probability p; the same as NAME=chance:p."),
    ] = None,
    sample_time: Annotated[
        float | None, typer.Option(help="Of the policy, in seconds; default: about 0.02, a multiple of the plant's.")
    ] = None,
    history: Annotated[int, typer.Option(help="Observations that the policy sees at once.", min=1)] = 1,
    observe_command: Annotated[
        bool, typer.Option("--observe-command", help="Show the policy its last command (for plants with a delay).")
    ] = False,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on after an interruption, or from a finished policy to more steps.")
    ] = False,
    trust: opt.Trust = False,
    tensorboard: Annotated[Path | None, typer.Option(help="Folder for TensorBoard logs.")] = None,
    seed: opt.Seed = 0,
    as_json: opt.AsJson = False,
) -> None:
    """Learn to balance, or to swing up and hold, on the compiled environment; 200 trials at the end say how well."""
    from controllers.training import Training, train
    from furuta_gym.plant import Plant

    training = Training(
        Plant.resolve(plant),
        task,
        algo,
        steps,
        seed,
        _randomize(randomize, ranges),
        _chances(effect_chance),
        sample_time,
        history,
        observe_command,
    )
    try:
        with counted("steps") as tell:
            record = train(
                training,
                output,
                resume=resume,
                trust=trust,
                tensorboard=tensorboard,
                command="furuta " + shlex.join(sys.argv[1:]),
                progress=tell,
            )
    except KeyboardInterrupt:
        if output.with_suffix(".checkpoint").exists():
            typer.echo("Interrupted. The same command with --resume goes on from the last checkpoint.", err=True)
        else:
            typer.echo("Interrupted before there was a checkpoint; nothing was kept.", err=True)
        raise typer.Exit(130) from None
    if as_json:
        print_json(record)
        return
    _report(output, record)


def _report(output: Path, record: dict[str, Any]) -> None:
    figures, spent = record["evaluation"], record["spent"]
    success = figures["success"]
    typer.echo(
        f"{output}: {record['algorithm']}, {record['steps']} steps in {spent['wall_s']:.0f} s "
        f"({spent['cpu_s']:.0f} s of CPU); record in {output.with_suffix('.json')}"
    )
    typer.echo(
        f"  {figures['trials']} trials of {record['task']}: {100 * success['value']:.4g} % succeed "
        f"({100 * success['low']:.0f}–{100 * success['high']:.0f} %)"
    )
    if success["value"] > 0:
        names = {"rms_q1": "rms q1 [rad]", "rms_q2": "rms q2 [rad]", "settling": "settling [s]"}
        typer.echo("  " + ", ".join(f"{text} {figures[name]['value']:.3g}" for name, text in names.items()))
    typer.echo(f"  Not trained for: {', '.join(record['not_trained_for'])}.")
    if success["value"] < 0.95:
        typer.echo("  Not learned yet: give it more --steps (with --resume), another --seed, or --algo.")


def _randomize(wanted: bool, ranges: list[str] | None) -> bool | dict[str, str]:
    """What `--randomize` and the words after it say. Raises ValueError."""
    if ranges and not wanted:
        raise ValueError(f"{' '.join(ranges)}: a range belongs to --randomize; write --randomize {' '.join(ranges)}")
    from furuta_gym.envs.ranges import as_mapping

    return as_mapping(ranges) if ranges else wanted


def _chances(texts: list[str] | None) -> dict[str, float]:
    """`NAME=p` as {name: p}. Raises ValueError."""
    found = {}
    for text in texts or ():
        name, equals, value = (part.strip() for part in text.partition("="))
        if not name or not equals:
            raise ValueError(f"--effect-chance {text!r}: expected NAME=p such as input_delay=0.5")
        (found[name],) = opt.numbers(f"--effect-chance {name}", value, (1,))
    return found
