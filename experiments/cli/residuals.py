"""`furuta residuals`: where and when a model fails on logs, without a name for what is missing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from . import options as opt
from .output import check_folder, print_json, write_json
from .reading import Reading, read, reads_logs
from .steps import steps

if TYPE_CHECKING:
    from identification.diagnosis.locate.location import Where
    from identification.diagnosis.locate.torque_maps import Map

CLEAR = 3.0
"""Times its error, from which a mean torque is marked; noise alone brings one mean of 370 so far."""


@reads_logs
def residuals_command(
    logs: opt.Logs,
    reading: Reading,
    plant: Annotated[
        str | None, typer.Option(help="Plant whose errors are shown; default: model (5), fitted to these logs.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Folder for residuals.png and residuals.json.")
    ] = None,
    as_json: opt.AsJson = False,
) -> None:
    """Show the torques that a model misses, over time and against each variable. It names no effect: that is for you.

    For a first guess before `furuta diagnose`, and for teaching.
    """
    from furuta_gym.plant import Plant
    from identification.diagnosis.locate.locate import locate
    from identification.estimation.zeros import aligned, moved

    if output is not None:
        check_folder(output)
    known = None if plant is None else Plant.resolve(plant)
    used = read(logs, reading, known)
    with steps("residuals", sum(map(len, used))) as step:
        if known is None:
            from identification.estimation.identify import identify

            step("fitting model (5)")
            estimate = identify(used)
            known, used = estimate.plant, tuple(moved(used, estimate.zeros))
        else:
            step("finding the zeros of the encoders")
            used = aligned(known, used).logs
        step("following the torques that are missing")
        where = locate(known, used)
    data = told(where)
    if output is not None:
        from .whole import whole_folder

        with whole_folder(output, ["residuals.png", "residuals.json"]) as folder:
            draw(where).savefig(folder / "residuals.png", dpi=120)
            write_json(folder / "residuals.json", data)
    if as_json:
        print_json(data)
        return
    show(where)
    if output is not None:
        typer.echo(f"Written: {output / 'residuals.png'}, {output / 'residuals.json'}")


def told(where: Where) -> dict[str, Any]:
    """What is shown, as JSON: sizes of the missing torques, when they stand out, and their means against variables."""
    rms = _rms(where)
    return {
        "unit": where.unit,
        "missing_torque_rms": {"arm": rms[0], "pendulum": rms[1]},
        "intervals_s": [[list(span) for span in spans] for spans in where.intervals_s],
        "maps": [m.to_dict() for m in where.maps],
    }


def show(where: Where) -> None:
    """The table: how much of each row's torque goes with each variable."""
    rms = _rms(where)
    table = Table("row", "against", "mean torque, rms", "largest, over its error", "there", title="Missing torque")
    for m in where.maps:
        size, ratio, at = _summary(m)
        mark = "[bold]" if ratio >= CLEAR else ""
        table.add_row(m.row, m.variable, f"{size:.2g} {where.unit}", f"{mark}{ratio:.1f}", f"{at:.3g}")
    console = Console()
    (console if console.is_terminal else Console(width=110)).print(table)
    typer.echo(f"smoothed, rms: arm {rms[0]:.2g} {where.unit}, pendulum {rms[1]:.2g} {where.unit}")
    for torque, spans in zip(where.torques, where.intervals_s, strict=True):
        when = ", ".join(f"{a:.2f} to {b:.2f} s" for a, b in spans) or "nowhere"
        typer.echo(f"stands out in {torque.source}: {when}")
    typer.echo("Name a suspect first. Then compare: furuta effects, furuta diagnose")


def _rms(where: Where) -> tuple[float, float]:
    count = sum(len(t.t) for t in where.torques)
    squares = [sum(float((t.mean[:, a] ** 2).sum()) for t in where.torques) for a in (0, 1)]
    return math.sqrt(squares[0] / count), math.sqrt(squares[1] / count)


def _summary(m: Map) -> tuple[float, float, float]:
    """Root mean square of a map's means, the largest over its error, and where that is."""
    import numpy as np

    known = np.isfinite(m.mean) & np.isfinite(m.std) & (m.std > 0)
    if not known.any():
        return 0.0, 0.0, float("nan")
    ratio = np.where(known, np.abs(m.mean) / np.where(known, m.std, 1.0), 0.0)
    at = int(np.argmax(ratio))
    middle = 0.5 * (m.edges[at] + m.edges[at + 1])
    return float(np.sqrt(np.mean(m.mean[known] ** 2))), float(ratio[at]), float(middle)


def draw(where: Where) -> Any:
    """The picture: the torques over time, and their means against each variable with 95 % bands."""
    from experiments.canvas import blank_figure

    columns = max(sum(m.row == row for m in where.maps) for row in ("arm", "pendulum"))
    figure = blank_figure(2.4 * columns, 8.0)
    grid = figure.add_gridspec(3, columns)
    _draw_times(figure.add_subplot(grid[0, :]), where)
    for i, row in enumerate(("arm", "pendulum"), 1):
        _draw_maps(figure, grid, i, [m for m in where.maps if m.row == row], where.unit)
    return figure


def _draw_times(axes: Any, where: Where) -> None:
    for torque in where.torques:
        for a, (row, colour) in enumerate((("arm", "tab:blue"), ("pendulum", "tab:orange"))):
            axes.plot(torque.t, torque.mean[:, a], color=colour, lw=0.9, label=f"{row}, {torque.source}")
            low, high = torque.mean[:, a] - 2 * torque.std[:, a], torque.mean[:, a] + 2 * torque.std[:, a]
            axes.fill_between(torque.t, low, high, color=colour, alpha=0.2, lw=0)
    axes.set(xlabel="time [s]", ylabel=f"missing torque [{where.unit}]", title="Torque that the model misses, smoothed")
    axes.legend(fontsize=8, ncol=4)


def _draw_maps(figure: Any, grid: Any, i: int, maps: Sequence[Map], unit: str) -> None:
    for j, m in enumerate(maps):
        axes = figure.add_subplot(grid[i, j])
        middle = 0.5 * (m.edges[1:] + m.edges[:-1])
        axes.axhline(0.0, color="0.7", lw=0.8)
        axes.errorbar(middle, m.mean, 2 * m.std, fmt="o", ms=3, lw=1, color="tab:blue" if i == 1 else "tab:orange")
        axes.set_xlabel(f"{m.variable} [{m.variable.unit.format(u=unit)}]", fontsize=8)
        axes.set_ylabel(f"{m.row} [{unit}]" if j == 0 else "", fontsize=8)
        axes.tick_params(labelsize=7)
