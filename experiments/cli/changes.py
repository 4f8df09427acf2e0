"""`furuta changes`: whether a rig has changed between two plant files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from . import options as opt
from .output import print_json

if TYPE_CHECKING:
    from furuta_gym.plant import Plant
    from identification.validation.plant_changes import PlantChange
    from identification.validation.side_by_side import Difference


_MANY = 100.0  # %, from which a smaller change is not given: the parameter is hardly known


def changes_command(
    before: Annotated[Path, typer.Argument(help="The older plant file.", metavar="BEFORE")],
    after: Annotated[
        list[Path], typer.Argument(help="The newer plant file, of other logs; several are compared one by one.")
    ],
    as_json: opt.AsJson = False,
) -> None:
    """Say which parameters of plant files differ by more than their error bars: has the rig changed since the first?"""
    from furuta_gym.plant import Plant
    from identification.estimation.identifiability import spoken
    from identification.validation.plant_changes import plant_change
    from identification.validation.side_by_side import CERTAIN, Estimated

    plants = []
    for path in (before, *after):
        plants.append(Plant.load(path))
        try:
            Estimated.of_plant(plants[-1])
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None
    changes = [plant_change(plants[0], plant) for plant in plants[1:]]
    for path, plant in zip((before, *after), plants, strict=True):
        for remark in _remarks(plant):
            typer.echo(f"Warning: {path}: {remark}", err=True)
    if len(after) > 1:
        _many(before, after, changes, as_json)
        return
    (found,) = changes
    if as_json:
        print_json(found.to_dict())
        return
    table = Table("", "before", "after", "change", "deviations", "shows from")
    for d in found.differences:
        table.add_row(*map(escape, _row(d, found.changed is not None)))
    console = Console()
    (console if console.is_terminal else Console(width=110)).print(table)
    typer.echo(f"deviations: the change over its standard deviation (! above {CERTAIN:g})")
    typer.echo(f"shows from: the least change that would be above {CERTAIN:g}")
    if found.unjudged:
        typer.echo(
            f"Not compared: {spoken(found.unjudged)}. r never is, nor what counts from the zero or the clock of a log, "
            "stands at its bound, or is shown by one plant alone."
        )
    typer.echo(str(found))


def _many(before: Path, after: Sequence[Path], changes: Sequence[PlantChange], as_json: bool) -> None:
    """Every later plant beside the first one: a rig over weeks."""
    from furuta_gym.files import told_apart
    from identification.estimation.estimate import rounded
    from identification.estimation.identifiability import spoken
    from identification.validation.side_by_side import CERTAIN

    if as_json:
        each = [{"after": str(path), **found.to_dict()} for path, found in zip(after, changes, strict=True)]
        print_json({"before": str(before), "changes": each})
        return
    columns = [{d.name: d for d in found.differences} for found in changes]
    names = told_apart([before, *after])
    table = Table("", *map(escape, names))
    for name in dict.fromkeys(name for column in columns for name in column):
        first = next(column[name] for column in columns if name in column)
        cells = [
            _cell(column.get(name), found.changed is not None) for column, found in zip(columns, changes, strict=True)
        ]
        unit = f" [{first.unit}]" if first.unit else ""
        table.add_row(*map(escape, (spoken([name]) + unit, rounded(*first.before), *cells)))
    console = Console()
    (console if console.is_terminal else Console(width=30 + 18 * len(names))).print(table)
    typer.echo(f"Change from {names[0]} and its standard deviation (! above {CERTAIN:g} of them)")
    for name, found in zip(names[1:], changes, strict=True):
        typer.echo(f"{name}: {found}")


def _cell(d: Difference | None, comparable: bool) -> str:
    from identification.validation.side_by_side import NORMAL_95

    if d is None:
        return "not compared"
    mark = " !" if d.certain and comparable else ""
    if d.percent is None:
        return f"to {d.after[0]:.3g} ± {d.after[1]:.2g}{mark}"
    return f"{d.percent[0]:+.2f} ± {d.percent[1] / NORMAL_95:.2g} %{mark}"


def _row(d: Difference, comparable: bool) -> tuple[str, ...]:
    from identification.estimation.estimate import rounded
    from identification.estimation.identifiability import spoken

    change = "" if d.percent is None else f"{d.percent[0]:+.1f} %"
    least = "" if d.shows_from is None else f"{d.shows_from:.2g} %" if d.shows_from < _MANY else f"above {_MANY:g} %"
    mark = " !" if d.certain and comparable else ""
    name = f"{spoken([d.name])} [{d.unit}]" if d.unit else spoken([d.name])
    return (name, rounded(*d.before), rounded(*d.after), change, f"{d.sure:+.1f}{mark}", least)


def _remarks(plant: Plant) -> list[str]:
    """What makes the error bars of a plant file doubtful."""
    found = [str(why)] if (why := plant.checks.get("error_bars")) else []
    if plant.checks.get("converged") is False:
        found.append("its fit did not converge, and its numbers are not an optimum")
    if plant.moved_by_hand:
        found.append("was moved by hand after the fit; its error bars are those of the fit")
    return found
