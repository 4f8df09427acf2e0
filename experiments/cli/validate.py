"""`furuta validate`: how far a plant predicts logs that it was not fitted to, and how far it could."""

from __future__ import annotations

import math
import shlex
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from . import options as opt
from .output import busy, check_folder, print_json, write_json
from .reading import Reading, reads_logs, tell_undriven
from .reading import read as read_logs

if TYPE_CHECKING:
    from furuta_gym.plant import Plant
    from identification.logs.log import Log

LONGEST = 5.0
"""Horizon that can be predicted over, in seconds."""


@reads_logs
def validate_command(
    plant: Annotated[str, typer.Argument(help="Plant file (or table3, qube, large).", metavar="PLANT")],
    logs: opt.Logs,
    reading: Reading,
    json_file: Annotated[
        Path | None, typer.Option("--json", help="Write the gap as JSON to this file; - prints it.", metavar="FILE")
    ] = None,
    horizon: Annotated[float | None, typer.Option(help="How far ahead to predict, in seconds. Default: 0.3.")] = None,
    plots: Annotated[Path | None, typer.Option(help="Folder for pictures: predictions, horizons, innovations.")] = None,
    limit: Annotated[
        float | None,
        typer.Option(
            help="Largest error over the noise floor that passes. The exit code is then 10 if it is larger, and 11 if "
            "nobody can say."
        ),
    ] = None,
    report: opt.Report = None,
) -> None:
    """Measure the gap between a plant and logs that were not fitted, against the noise floor."""
    printed = json_file is not None and str(json_file) == "-"
    if json_file is not None and not printed:
        opt.output_file(json_file, [".json"], [Path(plant), *logs])
    if horizon is not None and not 0 < horizon <= LONGEST:
        raise ValueError(f"--horizon {horizon:g}: expected seconds, above 0 and at most {LONGEST:g}")
    if limit is not None and not 1 <= limit < math.inf:
        raise ValueError(f"--limit {limit:g}: expected 1 or more, as 1 is a perfect plant")
    if plots is not None:
        check_folder(plots)
    opt.report_file(report, [Path(plant), *logs])
    from furuta_gym.plant import Plant

    if [log for log in logs if log.suffix == ".json"] and Path(plant).is_file() and not plant.endswith(".json"):
        raise ValueError(f"{plant} stands where the plant file is expected: furuta validate PLANT LOG…")
    rig = Plant.resolve(plant)
    read = read_logs(logs, reading, rig, "ignore")
    tell_undriven(read)
    from experiments.report.by_part import parts_of
    from furuta_gym.files import write_whole
    from identification.validation.adequacy import Adequacy
    from identification.validation.gap import HORIZON, validate
    from identification.validation.limit import checked
    from identification.validation.own_error_bars import expected_ratio, told

    from .whole import whole_folder

    with busy("predicting …", "validate", sum(map(len, read))):
        result = validate(rig, read, HORIZON if horizon is None else horizon)
        parts = parts_of(rig, result, read) if len(read) > 1 else None
    expected = None
    judged = result.judgement  # torques that are missing may raise a floor, and they have widened the error bars
    if (
        judged.adequacy in (Adequacy.SMALL, Adequacy.INADEQUATE)
        and not (judged.floor_in_doubt or result.at_rest)
        and rig.covariance
    ):
        with busy("predicting with plants drawn from the error bars …"):
            expected = expected_ratio(rig, read, result)
    measured = result.to_dict() | (parts.to_dict() if parts is not None else {})
    measured["gap"]["expected_of_error_bars"] = expected
    fitted = {entry.get("sha256") for entry in rig.provenance.get("logs") or []}
    seen = [log.source for log in read if log.sha256 in fitted]
    measured["fitted_logs"] = seen
    check = None if limit is None else checked(result, limit, seen)
    if check is not None:
        measured["check"] = check.to_dict()
    if seen:
        typer.echo(f"Warning: {', '.join(seen)} was {_fitted_to(rig)}; take a log that was not fitted.", err=True)
    look, remark = _look(rig, logs, read, reading.again(logs, read))
    page = ""
    # all is made before the first file is in its place, so that Ctrl-C meanwhile leaves nothing new
    with nullcontext() if plots is None else whole_folder(plots) as folder:
        if folder is not None:
            from identification.validation.plots import plot_horizons, plot_innovations, plot_predictions

            plot_predictions(result, read).savefig(folder / "predictions.png", dpi=120)
            plot_horizons({"plant": result}).savefig(folder / "horizons.png", dpi=120)
            plot_innovations(result).savefig(folder / "innovations.png", dpi=120)
        if report is not None:
            from experiments.report import render
            from experiments.report.validation_page import validation_page

            page = render(validation_page(result, rig, read, Path(plant).name, look, seen, parts))
    if report is not None:
        write_whole(report, page)
    if json_file is not None and not printed:
        write_json(json_file, measured)
    if printed:
        print_json(measured)
    else:
        typer.echo(result.told(f"on logs of which some were {_fitted_to(rig)}") if seen else str(result))
        if expected is not None and (explained := told(result.ratio_to_floor, expected)):
            typer.echo(f"  {explained[:1].upper()}{explained[1:]}.")
        if parts is not None:
            typer.echo(str(parts))
        if result.judgement.adequacy is not Adequacy.ADEQUATE and not result.says_little:  # the verdict says what to do
            typer.echo(f"Next: {look}{remark}")
        if plots is not None:
            typer.echo(f"Written: {plots}/predictions.png, horizons.png, innovations.png")
        if json_file is not None:
            typer.echo(f"Written: {json_file}")
        if report is not None:
            typer.echo(f"Written: {report}")
        if check is not None:
            typer.echo(str(check))
    if check is not None:
        raise typer.Exit(check.answer.exit_code)


def _fitted_to(rig: Plant) -> str:
    """What is said of a log that is one of the plant's own."""
    from identification.estimation.identifiability import spoken

    moved = rig.moved_by_hand
    return f"fitted before this plant was moved by hand ({spoken(moved)})" if moved else "fitted by this plant"


def _look(rig: Plant, logs: Sequence[Path], read: Sequence[Log], again: str) -> tuple[str, str]:
    """The command that looks for what is missing, with the logs that the plant was fitted to, where they are found, and
    a remark on it. again: the options that read the logs."""
    from identification.logs.formats import file_hash

    entries = rig.provenance.get("logs") or []
    known = {entry.get("sha256") for entry in entries}
    others = [shlex.quote(str(path)) for path, log in zip(logs, read, strict=True) if log.sha256 not in known]
    places = [_place(str(entry.get("source")), logs[0].parent) for entry in entries]
    hashes = [place and entry.get("sha256") and file_hash(place) for place, entry in zip(places, entries, strict=True)]
    replaced = any(h and h != entry.get("sha256") for h, entry in zip(hashes, entries, strict=True))
    if replaced and others:  # the name of a log that the plant was fitted to is another log's now
        held_out = f" --held-out {' '.join(others[1:])}" if others[1:] else ""
        return f"furuta diagnose {others[0]}{again}{held_out} -o diagnosis", ""
    searched = " ".join("LOG" if place is None else shlex.quote(str(place)) for place in places) or "LOG"
    remark = "" if others else "   (LOG: not fitted; works without --held-out too)"
    if others and any(places):
        both = f"furuta identify {searched} {' '.join(others)}{again}"
        remark = f"\nIf the rig may have changed between these logs, ask this first: {both} -o both.json"
    return f"furuta diagnose {searched}{again} --held-out {' '.join(others) or 'LOG'} -o diagnosis", remark


def _place(source: str, folder: Path) -> Path | None:
    """Where a plant's log is found: here, or beside the logs that were given."""
    return next((p for p in (Path(source), folder / source) if p.is_file()), None)
