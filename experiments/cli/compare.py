"""`furuta compare`: the same seeded trials for several controllers."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from . import options as opt
from .output import busy, check_folder, counted, print_json

if TYPE_CHECKING:
    from controllers.comparison.result import Comparison


def compare_command(
    plant: Annotated[str, typer.Option(help="Plant of the trials: table3, qube, large, or a plant file.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for comparison.json and the plots.")],
    controllers: Annotated[
        str, typer.Option(help="Names separated by commas, or policy files *.zip.")
    ] = "paper-lqr,lqr,dlqr,lqg",
    design_plant: Annotated[
        str | None, typer.Option(help="Plant that the controllers are designed from; default: the trials' plant.")
    ] = None,
    trials: Annotated[
        int,
        typer.Option(
            help="Trials of balance and of swing-up. Every other condition gets a quarter, but at least 10 and never "
            "more than this.",
            min=1,
        ),
    ] = 100,
    duration: Annotated[float, typer.Option(help="Length of a trial in seconds; of a swing-up 15 at least.")] = 10.0,
    groups: Annotated[
        str | None,
        typer.Option(
            help="Kinds of trials: balance, push, parameters, delay, quantisation, effects, swing_up, "
            "map (swing-ups over delay and error), or all. Default: balance,push,parameters,delay, and swing_up where "
            "a controller is named that swings up.",
        ),
    ] = None,
    sample_time: Annotated[
        float | None, typer.Option(help="Of the controllers, in seconds; default: the plant's, else 0.002.")
    ] = None,
    gif: Annotated[bool, typer.Option("--gif", help="Film every controller at work: CONTROLLER.gif.")] = False,
    jobs: Annotated[int, typer.Option(help="Processes.", min=1)] = 1,
    trust: opt.Trust = False,
    seed: opt.Seed = 0,
    as_json: opt.AsJson = False,
) -> None:
    """Play every controller in the same trials and say which is better at what, with 95 % intervals."""
    names = [name.strip() for name in controllers.split(",") if name.strip()]
    if not names:
        raise ValueError("--controllers is empty; expected names such as paper-lqr,lqr,lqg")
    opt.within("--duration", duration, 0.0, 600.0, "seconds, above 0 and at most 600")
    from controllers.comparison.conditions import GROUPS, check_groups
    from controllers.comparison.evaluation import compare
    from controllers.comparison.film import require_film
    from controllers.comparison.plots import draw_comparison
    from controllers.design import choose_sample_time
    from controllers.linear.law import LinearController
    from furuta_gym.envs.options import SHORTEST_SAMPLE
    from furuta_gym.plant import Plant

    from .whole import whole_folder

    groups = _usual(names) if groups is None else groups
    chosen = GROUPS if groups.strip() == "all" else [g.strip() for g in groups.split(",")]
    with opt.as_typed("groups", hints={"groups": ", separated by commas, or all"}):
        check_groups(chosen)
    if gif:
        require_film()
        if choose_sample_time(Plant.resolve(plant), sample_time) < SHORTEST_SAMPLE:
            raise ValueError(f"--gif: a film needs a sample time of {SHORTEST_SAMPLE:g} s at least; give --sample-time")
    check_folder(output)
    with (
        whole_folder(output, [*(f"comparison_{group}.png" for group in GROUPS), *_old_films(output)]) as folder,
        opt.as_typed("sample_time", "duration"),
    ):
        with counted("trials") as tell:
            result = compare(
                plant,
                names,
                design_plant=design_plant,
                trials=trials,
                duration=duration,
                sample_time=sample_time,
                groups=chosen,
                seed=seed,
                jobs=jobs,
                trust=trust,
                progress=tell,
            )
        written = [path.name for path in (result.save(folder), *draw_comparison(result, folder))]
        if gif:
            with busy("filming …"):
                written += _films(result, "swing_up" in chosen, folder, seed)
    if as_json:
        print_json(result.to_dict())
        return
    if "paper-lqr" in names and result.plant != Plant.resolve("table3"):
        typer.echo(
            "paper-lqr has the gains of the paper's rig (table3), not of this plant; it is there to compare with."
        )
    console = Console()
    if console.is_terminal:
        console.print(result.table())
    else:  # a file or a pipe has no width to keep
        typer.echo(str(result), nl=False)
    typer.echo(f"Written in {output}: {', '.join(written)}")
    linear = [name for name, policy in result.policies.items() if isinstance(policy, LinearController)]
    if best := _best([name for name in linear if name != "paper-lqr"], result):
        designed_for = plant if design_plant is None else design_plant
        own, used = choose_sample_time(Plant.resolve(designed_for), None), result.settings["sample_time"]
        period = "" if sample_time is None and own == used else f" --sample-time {used!r}"
        typer.echo(f"Next: furuta export {shlex.quote(designed_for)} --controller {best}{period} -o {best}.h")


def _best(names: Sequence[str], result: Comparison) -> str | None:
    """The controller that held in most trials of all conditions, of equals the last; None where none held in one."""
    held = {n: sum(f["success"].value or 0.0 for f in result.scores[n].values() if "success" in f) for n in names}
    most = max(held.values(), default=0.0)
    return [name for name in names if held[name] == most][-1] if most > 0.0 else None


def _films(result: Comparison, swing_up: bool, folder: Path, seed: int) -> list[str]:
    """A film of each controller; those that can swing up do so where that was compared."""
    from controllers.comparison.film import film
    from furuta_gym.sensors import Sensors

    sensors = Sensors.from_dict(result.settings["sensors"])
    names = _film_names(list(result.policies))
    for file, policy in zip(names, result.policies.values(), strict=True):
        task = "swing_up" if swing_up and "swing_up" in getattr(policy, "tasks", ()) else "balance"
        film(result.plant, policy, result.settings["sample_time"], sensors, folder / file, task=task, seed=seed)
    return names


def _film_names(controllers: Sequence[str]) -> list[str]:
    """A file name for each controller; of one name the second has -2."""
    stems = [Path(name).stem.replace(" ", "-") for name in controllers]
    same = [stems[:k].count(stem) for k, stem in enumerate(stems)]
    return [f"{stem}-{n + 1}.gif" if n else f"{stem}.gif" for stem, n in zip(stems, same, strict=True)]


def _old_films(folder: Path) -> list[str]:
    """Films that the comparison which is in a folder may have made."""
    from controllers.comparison.result import Comparison

    try:
        return _film_names(list(Comparison.load(folder / "comparison.json").scores))
    except (OSError, ValueError):  # none is there, or none that can be read
        return []


def _usual(names: Sequence[str]) -> str:
    """The groups that are played where none is named."""
    from controllers.learned.policy_file import read_record

    def swings_up(name: str) -> bool:
        if not name.endswith(".zip"):
            return name in ("swing-up", "planned")
        env = read_record(name).get("env") if Path(name).is_file() else None
        return isinstance(env, Mapping) and env.get("task") == "swing_up"

    return "balance,push,parameters,delay" + (",swing_up" if any(map(swings_up, names)) else "")
