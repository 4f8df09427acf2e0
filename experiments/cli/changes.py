"""`furuta changes`: whether a rig has changed between two plant files."""

from __future__ import annotations

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
    from identification.validation.side_by_side import Difference


_MANY = 100.0  # %, from which a smaller change is not given: the parameter is hardly known


def changes_command(
    before: Annotated[Path, typer.Argument(help="The older plant file.", metavar="BEFORE")],
    after: Annotated[Path, typer.Argument(help="The newer plant file, of other logs.", metavar="AFTER")],
    as_json: opt.AsJson = False,
) -> None:
    """Say which parameters of two plant files differ by more than their error bars: has the rig changed?"""
    from furuta_gym.plant import Plant
    from identification.estimation.identifiability import spoken
    from identification.validation.plant_changes import plant_change
    from identification.validation.side_by_side import CERTAIN, Estimated

    plants = []
    for path in (before, after):
        plants.append(Plant.load(path))
        try:
            Estimated.of_plant(plants[-1])
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None
    found = plant_change(*plants)
    for path, plant in zip((before, after), plants, strict=True):
        for remark in _remarks(plant):
            typer.echo(f"Warning: {path}: {remark}", err=True)
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
