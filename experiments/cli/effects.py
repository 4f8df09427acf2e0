"""`furuta effects`: the library in words."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from . import options as opt
from .output import print_json

if TYPE_CHECKING:
    from furuta_gym.plant.effects.declaration import EffectType, Parameter


_SHOWN = 8  # of the parameters of one effect, in a row of the table


def effects_command(
    name: Annotated[str | None, typer.Argument(help="One effect in detail; default: all of them.")] = None,
    as_json: opt.AsJson = False,
) -> None:
    """The effects that a plant can have: what each does, how it shows on a rig, and its look-alikes.

    A diagnosis can name all of them but arm_learned, which is fitted where the named ones leave too much."""
    from furuta_gym.plant import EFFECTS, Effect
    from furuta_gym.plant.effects.library import CARRIED

    if name is not None:
        kind = Effect(name).type  # a wrong name is told with what is near
        if as_json:
            print_json(described(kind))
        else:
            typer.echo(in_detail(kind))
        return
    if as_json:
        print_json([described(kind) for kind in CARRIED.values()])
        return
    table = Table(
        "effect", "acts on", "on the rig", "parameters", title=f"{len(EFFECTS)} effects, and one to be learned"
    )
    for kind in CARRIED.values():
        units = ", ".join(f"{p.name} [{_unit(p)}]" if _unit(p) else p.name for p in kind.parameters[:_SHOWN])
        units += f" … ({len(kind.parameters)} parameters)" if len(kind.parameters) > _SHOWN else ""
        table.add_row(kind.name, kind.place, escape(kind.symptom), escape(units))
    console = Console()
    (console if console.is_terminal else Console(width=140)).print(table)
    typer.echo("{u} is the command's unit, V or N·m. One in detail: furuta effects NAME")


def described(kind: EffectType) -> dict[str, Any]:
    """An effect as JSON has it. named: whether a diagnosis can name it."""
    from furuta_gym.plant import EFFECTS

    return {
        "name": kind.name,
        "place": kind.place,
        "equation": kind.equation,
        "symptom": kind.symptom,
        "parameters": [{"name": p.name, "unit": p.unit, "meaning": p.meaning, "role": p.role} for p in kind.parameters],
        "mistaken_for": list(kind.mistaken_for),
        "named": kind.name in EFFECTS,
    }


def in_detail(kind: EffectType) -> str:
    """An effect in sentences."""
    lines = [
        f"{kind.name}: acts on the {kind.place}",
        f"  on the rig   {kind.symptom}",
        f"  equation     {kind.equation}",
    ]
    for p in kind.parameters:
        lines.append(f"  {p.name:<12} {p.meaning}{f' [{_unit(p)}]' if _unit(p) else ''}")
    if kind.mistaken_for:
        lines.append(f"  look-alikes  {', '.join(kind.mistaken_for)}")
    lines += [
        f"Try it: furuta simulate --plant table3 --controller lqr --excitation paper --effect {kind.name} -o log.csv",
        "{u} is the command's unit, V or N·m.",
    ]
    return "\n".join(lines)


def _unit(p: Parameter) -> str:
    return "" if p.unit in ("", "1", "-") else p.unit
