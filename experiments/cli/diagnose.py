"""`furuta diagnose`: which effect the model misses, if any."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from . import options as opt
from .output import busy, print_json, whole_folder, write_json


def diagnose_command(
    logs: opt.Logs,
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for diagnosis.json and plant.json.")],
    held_out: Annotated[
        list[Path] | None, typer.Option(help="Log that is not fitted, to show the gap shrink; repeat it for more.")
    ] = None,
    plant: Annotated[str | None, typer.Option(help="Plant to start from; default: from the logs.")] = None,
    max_effects: Annotated[int, typer.Option(min=1, help="Effects to look for at most.")] = 3,
    columns: opt.Columns = None,
    unit: opt.Unit = None,
    pendulum_zero: opt.PendulumZero = None,
    flip: opt.Flip = None,
    encoder_counts: opt.EncoderCounts = None,
    input_unit: opt.InputUnit = None,
    as_json: opt.AsJson = False,
) -> None:
    """Search the library of effects for what model (5) misses in logs of one rig, and add it to the plant."""
    from furuta_gym.plant import Plant
    from identification.logs import read_logs

    if plant is not None:
        Plant.resolve(plant)
    mapping = opt.mapping(columns, unit, pendulum_zero, flip, encoder_counts, input_unit)
    read = read_logs(logs, **mapping)
    held = read_logs(held_out, **mapping) if held_out else ()
    from identification.diagnosis.diagnose import diagnose

    with busy("diagnosing …"):
        found = diagnose(read, plant, max_effects)
        gap = _gap(found, held) if found.after else None
    result = found.to_dict() | ({"gap": gap} if gap else {})
    with whole_folder(output) as folder:
        write_json(folder / "diagnosis.json", result)
        if found.plant is not None:
            found.plant.save(folder / "plant.json")
    if as_json:
        print_json(result)
        return
    typer.echo(str(found))
    if gap:
        low, high = gap["closed_interval"]
        typer.echo(
            f"  held-out gap closed: {100 * gap['closed_fraction']:.0f} % (95 %: {100 * low:.0f} … {100 * high:.0f} %)"
        )
        typer.echo(
            f"  held-out error over reading noise: {gap['ratio_before']:.2f} before, {gap['ratio_after']:.2f} after"
        )
    typer.echo(f"Written: {output}/diagnosis.json" + (f", {output}/plant.json" if found.plant is not None else ""))


def _gap(found: Any, held: Any) -> dict[str, Any] | None:
    """The gap on held-out logs before and after, as diagnosis.json has it."""
    if not held:
        return None
    from identification.validation import closed_fraction, validate

    before, after = validate(found.before.plant, held), validate(found.after.plant, held)
    closed = closed_fraction(before, after)
    sides = {
        side: {"rms_q1": float(gap.rms[0]), "rms_q2": float(gap.rms[1])}
        for side, gap in (("before", before), ("after", after))
    }
    return sides | {
        "noise_floor": {"rms_q1": float(before.floor[0]), "rms_q2": float(before.floor[1])},
        "ratio_before": before.ratio_to_floor,
        "ratio_after": after.ratio_to_floor,
        "closed_fraction": closed.value,
        "closed_interval": list(closed.interval),
        "held_out": True,
    }
