"""`furuta train`: a policy learned on a plant, with the record of how."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from . import options as opt
from .output import check_folder, counted, print_json


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
    algo: Annotated[str, typer.Option(help="ppo, sac, tqc, or recurrent (PPO with a memory).")] = "ppo",
    recipe: Annotated[
        str,
        typer.Option(
            help="plain, or robust: for rigs with input delay, parameter differences and a cable that pulls the arm. "
            "Options given beat it."
        ),
    ] = "plain",
    steps: Annotated[
        int | None,
        typer.Option(
            help="Env steps in all, rounded up to whole rollouts; default: the recipe's, 2 or 8 million. "
            "SAC and TQC need far fewer: 40,000, with robust 100,000.",
            min=1,
        ),
    ] = None,
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
    history: Annotated[
        int | None,
        typer.Option(help="Observations that the policy sees at once; default: the recipe's, 1 for recurrent.", min=1),
    ] = None,
    observe_command: Annotated[
        bool, typer.Option("--observe-command", help="Append the last command to each observation (for a late rig).")
    ] = False,
    reward: Annotated[
        list[str] | None,
        typer.Option(help="NAME=WEIGHT in [0, 1] of centred, calm, sparing or gentle (changes of the command)."),
    ] = None,
    noise: Annotated[float | None, typer.Option(help="Noise of both angles in rad; default: the plant file's.")] = None,
    arm_limit: Annotated[
        float | None,
        typer.Option(help="An arm beyond so many rad ends the episode; default: the plant's, else 2π."),
    ] = None,
    arm_margin: Annotated[
        float | None, typer.Option(help="The reward falls to zero over so many rad before the arm's limit.")
    ] = None,
    curriculum: Annotated[
        float | None,
        typer.Option(
            help="Begin with a fifth of the ranges; widen them at this share of successful episodes, say 0.9."
        ),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on after an interruption, or from a finished policy to more steps.")
    ] = False,
    trust: opt.Trust = False,
    tensorboard: Annotated[Path | None, typer.Option(help="Folder for TensorBoard logs.")] = None,
    seed: opt.Seed = 0,
    as_json: opt.AsJson = False,
) -> None:
    """Learn to balance, or to swing up and hold, on the compiled environment; 200 trials at the end say how well."""
    from controllers.training.curriculum import Curriculum
    from controllers.training.train import Training, train
    from furuta_gym.plant import Plant

    check_folder(output.parent)
    opt.within("--noise", noise, -1e-300, 1.0, "rad, from 0 to 1")
    opt.within("--arm-limit", arm_limit, 0.0, 1e6, "rad, above 0")
    opt.within("--arm-margin", arm_margin, -1e-300, 1e6, "rad, 0 or more")
    opt.within("--curriculum", curriculum, 0.0, 1.0, "a share of successes above 0, at most 1, such as 0.9")
    with opt.as_typed("randomize", "sample_time"):
        training = Training.of_recipe(
            Plant.resolve(plant),
            recipe,
            task=task,
            algorithm=algo,
            steps=steps,
            seed=seed,
            randomize=_randomize(randomize, ranges),
            effect_probabilities=_chances("--effect-chance", effect_chance, "input_delay=0.5"),
            sample_time=sample_time,
            history=history,
            observe_command=observe_command or None,
            reward_weights=_chances("--reward", reward, "gentle=0.3"),
            noise_std=noise,
            arm_limit=arm_limit,
            arm_margin=arm_margin,
            curriculum=None if curriculum is None else Curriculum(curriculum),
        )
    if training.drawn_otherwise:
        typer.echo(training.drawn_otherwise, err=True)
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


FIGURES = {
    "settling": "up after [s]",
    "largest_q1": "largest q1 [rad]",
    "energy": "effort ∫u² dt",
    "roughness": "roughness [{u}/s]",
    "rms_q1": "rms q1 [rad]",
    "rms_q2": "rms q2 [rad]",
}


def _report(output: Path, record: dict[str, Any]) -> None:
    figures, spent = record["evaluation"], record["spent"]
    success = figures["success"]
    typer.echo(
        f"{output}: {record['algorithm']}, {record['steps']} steps in {spent['wall_s']:.0f} s "
        f"({spent['cpu_s']:.0f} s of CPU); record in {output.with_suffix('.json')}"
    )
    typer.echo(f"  {figures['trials']} trials of {record['task']}: {_rate(success)} succeed")
    if success["value"] > 0:
        _figures(figures, record)
    if drawn := record.get("drawn_rigs"):
        typer.echo(
            f"  On {drawn['episodes']} rigs drawn as in training: {_rate(drawn['success'])} succeed; "
            f"return {drawn['return']:.3g}, of the worst 5 % {drawn['worst_return']:.3g}"
        )
    if record["curriculum"] is not None:
        typer.echo(f"  The curriculum widened the ranges to {100 * record['level']:.0f} % of what was asked for.")
    typer.echo(f"  Not trained for: {', '.join(record['not_trained_for'])}.")
    if success["value"] < 0.95:
        typer.echo("  Not learned yet: give it more --steps (with --resume), another --seed, or --algo.")


def _figures(figures: dict[str, Any], record: dict[str, Any]) -> None:
    table = Table("", "typical", "worst 5 %", box=None, padding=(0, 2))
    names = {**FIGURES, "settling": FIGURES["settling"] if record["task"] == "swing_up" else "settling [s]"}
    for name, text in names.items():
        values = (figures.get(of, {}).get("value") for of in (name, f"worst_{name}"))
        cells = ["–" if value is None else f"{value:.3g}" for value in values]
        table.add_row(escape(text.format(u=record["plant"]["unit"])), *cells)
    Console(width=None if Console().is_terminal else 100).print(table)


def _rate(success: dict[str, float]) -> str:
    return f"{100 * success['value']:.4g} % ({100 * success['low']:.0f}–{100 * success['high']:.0f} %)"


def _randomize(wanted: bool, ranges: list[str] | None) -> bool | dict[str, str] | None:
    """What `--randomize` and the words after it say; None for nothing. Raises ValueError."""
    if ranges and not wanted:
        raise ValueError(f"{' '.join(ranges)}: a range belongs to --randomize; write --randomize {' '.join(ranges)}")
    from furuta_gym.envs.ranges import as_mapping

    return as_mapping(ranges) if ranges else wanted or None


def _chances(option: str, texts: list[str] | None, example: str) -> dict[str, float]:
    """`NAME=p` as {name: p}. Raises ValueError."""
    found = {}
    opt.once(option, [text.partition("=")[0].strip() for text in texts or ()])
    for text in texts or ():
        name, equals, value = (part.strip() for part in text.partition("="))
        if not name or not equals:
            raise ValueError(f"{option} {text!r}: expected NAME=p such as {example}")
        (found[name],) = opt.numbers(f"{option} {name}", value, (1,))
        if not 0.0 <= found[name] <= 1.0:
            raise ValueError(f"{option} {name}={value}: expected a number from 0 to 1, such as {example}")
    return found
