"""How often do 95 % intervals hold the truth, where the model is right, where a law is another one, and where an effect
is missing? On rigs of the virtual bench, whose parameters are known.

`python -m experiments.studies.error_bars` identifies each rig with the names of its effects given, and by model (5)
alone. It counts intervals as they are stated, and as they would be if the model were right. Writes error_bars.csv, and
prints the rates.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import numpy as np
import pandas as pd
import typer
from joblib import delayed

from experiments.cli.errors import explained
from experiments.studies.finished import finished
from experiments.trials.plan import make_plan
from experiments.trials.report import percent
from experiments.trials.seal import FIT_LOG, seal, write_logs
from experiments.trials.summary import rate_over_rigs
from experiments.trials.trial import Trial
from experiments.workers import workers
from furuta_gym.files import write_whole
from furuta_gym.plant.covariance import NORMAL_95
from identification.estimation.estimate import Estimate
from identification.estimation.identify import identify
from identification.logs.reading import read_logs

MODELS = {
    "right": "the right model",
    "another law": "the right names, another law",
    "missing": "model (5), effects missing",
}
"""What the fitted model is to the rig: kind, and how the table calls it."""
_LOG = ("theta1", "theta2", "theta3", "theta4", "theta5")  # their logarithms are estimated


def examined(trial: Trial) -> list[dict[str, Any]]:
    """A row for every parameter of a rig that is identified and whose truth is known: the model, and whether the
    interval holds the truth, as stated (`inside`) and as of a right model (`inside_if_right`). A rig that could not
    be recorded or identified has one row, with `problem`."""
    about = {"id": trial.id, "kind": trial.kind, "subject": trial.subject, "problem": ""}
    sealed = seal(trial)
    if "problem" in sealed:
        return [about | {"problem": sealed["problem"]}]
    truth = sealed["truth"]
    effects = truth["effects"]
    own = all(e["form"] == "table" for e in effects) and truth["base_friction"] == "smooth"
    wanted = {"right" if own else "another law": tuple(e["name"] for e in effects)}
    if effects:
        wanted["missing"] = ()
    rows: list[dict[str, Any]] = []
    with TemporaryDirectory(prefix="error-bars-") as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # advice for a person
        write_logs(sealed, Path(folder))
        logs = read_logs([Path(folder) / FIT_LOG])
        for model, names in wanted.items():
            try:
                estimate = identify(logs, effects=names)
            except ValueError as error:
                rows.append(about | {"model": model, "problem": str(error)})
                continue
            rows += [about | {"model": model} | row for row in compared(estimate, known(truth))]
    return rows


def known(truth: Mapping[str, Any]) -> dict[str, float]:
    """What can be compared of a rig: θ, and parameters of effects that follow the library's law."""
    found = dict(truth["theta"])
    for effect in truth["effects"]:
        if effect["form"] == "table":
            found |= {f"{effect['name']}.{key}": p["value"] for key, p in effect["parameters"].items()}
    return found


def compared(estimate: Estimate, truth: Mapping[str, float]) -> Iterator[dict[str, Any]]:
    """A row for every parameter that is identified, has an error bar and is in `truth`."""
    each = zip(estimate.names, estimate.values, estimate.std, estimate.std_if_right, strict=True)
    for name, value, std, right in each:
        if name not in truth or name in estimate.identifiability.unidentified or not 0.0 < right < math.inf:
            continue
        error = off(name, float(value), truth[name])
        yield {
            "parameter": name,
            "deviations": error / std,
            "deviations_if_right": error / right,
            "widened": std / right,
            "inside": bool(error <= NORMAL_95 * std),
            "inside_if_right": bool(error <= NORMAL_95 * right),
        }


def off(name: str, value: float, true: float) -> float:
    """How far a value is from the truth, on the scale on which it is estimated."""
    if name in _LOG and value > 0 and true > 0:
        return abs(value * math.log(value / true))
    return abs(value - true)


def table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Markdown: for each model and kind of parameter, how many intervals hold the truth."""
    lines = [
        "| fitted model | parameters | rigs | stated intervals hold | those of a right model | wider by, median |",
        "|---|---|---|---|---|---|",
    ]
    for model, called in MODELS.items():
        for kind, of_theta in (("θ", True), ("of effects", False)):
            mine = [r for r in rows if r.get("model") == model and not r["problem"]]
            mine = [r for r in mine if r["parameter"].startswith("theta") == of_theta]
            if mine:
                rigs = {r["id"] for r in mine}
                stated, alone = (
                    percent(rate_over_rigs([r[key] for r in mine if r["id"] == rig] for rig in rigs))
                    for key in ("inside", "inside_if_right")
                )
                wider = np.median([r["widened"] for r in mine])
                lines.append(f"| {called} | {kind} | {len(rigs)} | {stated} | {alone} | {wider:.2f} |")
    return "\n".join(lines) + "\n"


def plan(seed: int, split: str, effects: int, composite: int, none: int) -> list[Trial]:
    """So many rigs with one effect, with three to five, and with none."""
    found = []
    for kind, wanted in (("library", effects), ("composite", composite), ("none", none)):
        found += make_plan(split, seeds=2, kinds=[kind], seed=seed)[:wanted] if wanted else []
    return found


def main(
    effects: Annotated[int, typer.Option(help="Rigs with one effect.", min=0, max=240)] = 40,
    composite: Annotated[int, typer.Option(help="Rigs with three to five.", min=0, max=24)] = 12,
    none: Annotated[int, typer.Option(help="Rigs with none.", min=0, max=16)] = 8,
    seed: Annotated[int, typer.Option(help="Another one draws other rigs.", min=0)] = 54,
    split: Annotated[str, typer.Option(help="Of the trials: dev or final.")] = "final",
    jobs: Annotated[int, typer.Option(help="Processes.", min=1)] = 2,
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder to write to.")] = Path("out/error_bars"),
) -> None:
    """Count how often 95 % intervals hold the truth."""
    with explained(), workers("loky", jobs):
        trials = plan(seed, split, effects, composite, none)
        rows: list[dict[str, Any]] = []
        for found in finished([delayed(examined)(trial) for trial in trials], "rigs"):
            rows += found
        rows.sort(key=lambda r: (r["id"], r.get("model", ""), r.get("parameter", "")))
        write_whole(output / "error_bars.csv", pd.DataFrame(rows).to_csv(index=False))
        typer.echo(table(rows))
        if lost := [row for row in rows if row["problem"]]:
            typer.echo(f"not counted: {len(lost)} ({lost[0]['problem']})")


if __name__ == "__main__":
    typer.run(main)
