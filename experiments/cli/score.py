"""`furuta score`: what a controller did on the rig, in the figures of `furuta compare`."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from . import options as opt
from .output import print_json
from .reading import Reading, read, reads_logs

if TYPE_CHECKING:
    from controllers.comparison.measured_run import RunFigures
    from furuta_gym.plant import Plant


@reads_logs
def score_command(
    logs: opt.Logs,
    reading: Reading,
    swing_up: Annotated[
        bool, typer.Option("--swing-up", help="The runs begin hanging; the last 5 s are to be upright.")
    ] = False,
    arm_travel: Annotated[
        float | None,
        typer.Option(
            help="To either side, in rad; a run has failed where the arm leaves it. Default: limits.arm_travel of "
            "--plant, else 2π."
        ),
    ] = None,
    plant: Annotated[
        str | None,
        typer.Option(
            help="Plant file of the rig: for its arm's travel and speed, for how its logs are read, and for what its "
            "encoders are known to read wrongly."
        ),
    ] = None,
    as_json: opt.AsJson = False,
) -> None:
    """Say how well a controller did in logs of the rig: the figures that `furuta compare` gives for simulated runs."""
    from controllers.comparison.measured_run import run_figures
    from controllers.comparison.trials import HORIZONTAL
    from controllers.known_effects import KnownEffects
    from furuta_gym.plant import Plant
    from furuta_gym.plant.plant_file import ARM_TRAVEL

    if arm_travel is not None and not arm_travel > 0:
        raise ValueError(f"--arm-travel {arm_travel:g}: expected rad, above 0")
    known = None if plant is None else Plant.resolve(plant)
    if arm_travel is None:
        arm_travel = ARM_TRAVEL if known is None else known.limit("arm_travel", ARM_TRAVEL)
    used = read(logs, reading, known)
    undone, limits = (None, {}) if known is None else (KnownEffects(known), _speed_limit(known))
    found = []
    for log in used:
        try:
            q1, q2 = log.angles.T if undone is None else undone.angles(log.angles.T)
            found.append(run_figures(log.t, q1, q2, log.u, swing_up=swing_up, arm_travel=arm_travel, **limits))
        except ValueError as error:
            raise ValueError(f"{log.source}: {error}") from error
    unit = used[0].input_unit
    if as_json:
        print_json(
            {"unit": unit, "runs": [{"log": log.source, **asdict(f)} for log, f in zip(used, found, strict=True)]}
        )
        return
    hangs = [] if swing_up else [log.source for log in used if abs(math.remainder(log.q2[0], 2 * math.pi)) > HORIZONTAL]
    _show([log.source for log in used], found, unit, hangs)


def _speed_limit(plant: Plant) -> dict[str, float]:
    """The arm's largest speed that a plant file says, and a count of its encoder."""
    from controllers.design import choose_sensors

    count = float(choose_sensors(plant, None).resolution[0])
    return {"arm_speed": plant.limit("arm_speed", math.inf), "count": count}


def _show(names: list[str], found: list[RunFigures], unit: str, hangs: list[str]) -> None:
    """hangs: names of logs that begin hanging though they are scored as balancing."""
    heads = ("log", "held", "rms q1\n[rad]", "mean q1\n[rad]", "rms q2\n[rad]", f"energy\n[{unit}²·s]")
    table = Table(*map(escape, (*heads, f"roughness\n[{unit}/s]", "settled\n[s]")))
    for name, f in zip(names, found, strict=True):
        held = "to the end" if f.failed_at is None else f"{f.failed_at:.2f} s ({f.why})"
        figures = (f"{f.rms_q1:.3f}", f"{f.mean_q1:+.3f}", f"{f.rms_q2:.4f}", f"{f.energy:.3g}", f"{f.roughness:.3g}")
        table.add_row(escape(name), held, *figures, "no" if f.settling is None else f"{f.settling:.2f}")
    console = Console()
    (console if console.is_terminal else Console(width=110)).print(table)
    if hangs:
        typer.echo(f"Note: {', '.join(hangs)} begins hanging. Give --swing-up, if the run is to swing up.")
    typer.echo("As furuta compare has them for simulated runs. Encoder noise is part of what is read.")
