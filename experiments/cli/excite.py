"""`furuta excite`: a plant in; the experiment that will say most about it, or about two suspects, out."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from . import options as opt
from .output import print_json
from .steps import steps

if TYPE_CHECKING:
    from furuta_gym.plant import Plant
    from identification.design.d_optimal import Design
    from identification.design.discriminate import Separation


def excite_command(
    plant: Annotated[str, typer.Option(help="table3, qube, large, or a plant file.")],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Command file to write: .csv, .parquet, .npz or .mat.")
    ],
    between: Annotated[
        str | None, typer.Option(help="Separate these effects instead: EFFECT,EFFECT.", metavar="EFFECT,EFFECT")
    ] = None,
    controller: Annotated[
        str | None,
        typer.Option(
            help="Controller in the loop: paper-lqr, lqr, …, or none for a hanging pendulum. Default: paper-lqr if it "
            "holds the plant, else lqr."
        ),
    ] = None,
    limits: Annotated[
        str | None,
        typer.Option(
            help="Largest arm angle, pendulum angle from rest (rad), command and its change a second: "
            "q1=1.2,q2=0.3,u=8,u_rate=2000."
        ),
    ] = None,
    duration: Annotated[float | None, typer.Option(help="In seconds. Default: 20, or 10 with --between.")] = None,
    sample_time: Annotated[float | None, typer.Option(help="In seconds; default: the plant's, else 0.002.")] = None,
    seed: opt.Seed = 0,
    as_json: opt.AsJson = False,
) -> None:
    """Design an experiment: D-optimal for θ, or the one that separates effects, with the precision to expect."""
    opt.log_file(output, [Path(plant)])
    opt.within("--duration", duration, 0.0, 600.0, "seconds, above 0 and at most 600")
    opt.within("--sample-time", sample_time, 0.0, 1.0, "seconds, above 0 and at most 1")
    given = _limits(limits)
    if between is not None:
        suspects = opt.names(between)
        opt.library_effects("--between", suspects)
        if len(suspects) < 2:
            raise ValueError(f"--between {between}: expected two effects or more, such as input_delay,actuator_lag")
    from furuta_gym import Plant
    from identification import excite
    from identification.design.next_experiment import doubt

    rig = Plant.resolve(plant)
    policy = _policy(controller, rig, sample_time)
    if doubted := doubt(rig):
        warnings.warn(doubted, stacklevel=1)
    with steps("excite") as tell:
        tell("designing")
        result = excite(
            rig, between, policy, limits=given, duration=duration, sample_time=sample_time, seed=seed, progress=tell
        )
    column = "u" if result.whole_command else "d"
    _write(output, result, column, {"plant": plant, "controller": getattr(policy, "name", "none")})
    if as_json:
        print_json(result.to_dict() | {"file": str(output), "column": column})
        return
    typer.echo(str(result))
    what = "u is the whole command" if result.whole_command else "add d to the command of the controller"
    typer.echo(f"Written: {output} (columns t, {column}: {what})")


def _limits(text: str | None) -> dict[str, float]:
    """`q1=1.2,q2=0.3` as {name: limit}. Raises ValueError."""
    names = ("q1", "q2", "u", "u_rate")
    found = {}
    for part in (text or "").split(",") if text else ():
        name, equals, value = (s.strip() for s in part.partition("="))
        if name not in names or not equals:
            raise ValueError(f"--limits {part!r}: expected {', '.join(names)} with a number each, as q1=1.2,q2=0.3")
        found[name] = opt.numbers(f"--limits {name}", value, (1,))[0]
        if found[name] <= 0:
            raise ValueError(f"--limits {part!r}: expected a positive number")
    return found


def _policy(name: str | None, rig: Plant, sample_time: float | None) -> Any:
    """The controller of the loop, or None for a hanging pendulum."""
    if name == "none":
        return None
    from controllers import make_controller, usual_controller

    if name is not None:
        policy = make_controller(name, rig, sample_time)
        if "balance" not in policy.tasks:
            raise ValueError(f"--controller {name}: expected one that balances, or none for a hanging pendulum")
        return policy
    return usual_controller(rig, sample_time)


def _write(path: Path, result: Design | Separation, column: str, facts: dict[str, str]) -> None:
    from identification.logs.formats import write_table

    t, d = result.samples()
    path.parent.mkdir(parents=True, exist_ok=True)
    write_table(path, {"t": t, column: d}, facts | result.facts)
