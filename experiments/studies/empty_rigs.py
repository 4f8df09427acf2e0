"""How often is something said to be left where nothing is missing? On empty rigs of two simulators that share no code.

`python -m experiments.studies.empty_rigs --rigs 100` identifies model (5) on rigs of the bench and of the plain
laboratory (rounding, and no other noise), and looks at what is left. Writes empty_rigs.csv, and prints the rates.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import pandas as pd
import typer
from joblib import delayed

from experiments.cli.errors import explained
from experiments.studies.finished import finished
from experiments.trials.plan import make_plan
from experiments.trials.report import percent
from experiments.trials.seal import FIT_LOG, seal, write_logs
from experiments.trials.summary import rate
from experiments.trials.trial import Trial
from experiments.workers import workers
from furuta_gym.files import write_whole
from identification.diagnosis.locate.locate import locate
from identification.diagnosis.policy import DecisionPolicy
from identification.estimation.identify import identify
from identification.estimation.zeros import moved
from identification.logs.reading import read_logs

SIMULATORS = {"none": "the bench", "rounding": "the plain laboratory"}


def examined(trial: Trial) -> dict[str, Any]:
    """What is left of an empty rig's log: evidence [nats], its size [counts], and whether it is said to matter.

    A rig whose pendulum is lost, or that cannot be identified, has `problem`.
    """
    about = {"id": trial.id, "simulator": SIMULATORS[trial.kind], "rig": trial.rig, "experiment": trial.experiment}
    sealed = seal(trial)
    if "problem" in sealed:
        return about | {"problem": sealed["problem"]}
    with TemporaryDirectory(prefix="empty-rigs-") as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # advice for a person
        write_logs(sealed, Path(folder))
        logs = read_logs([Path(folder) / FIT_LOG])
        try:
            estimate = identify(logs)
            rest = locate(estimate.plant, moved(logs, estimate.zeros), DecisionPolicy())
        except ValueError as error:
            return about | {"problem": str(error)}
    return about | {
        "found": rest.found,
        "evidence": rest.evidence,
        "counts": float(rest.counts.max()),
        "matters": rest.matters,
        "constant_p": rest.constancy.joint_p,
        "changing": rest.changing,
        "problem": "",
    }


def plan(rigs: int, seed: int, split: str = "final") -> list[Trial]:
    """So many empty rigs of each simulator."""
    found = []
    for kind, each in (("none", 8), ("rounding", 24)):  # of one seed of a plan
        trials = make_plan(split, -(-rigs // each), kinds=[kind], seed=seed)
        found += trials[:rigs]
    return found


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Markdown: for each simulator, how often anything is found, and how often it is said to matter."""
    lines = [
        "| simulator | evidence above the limit | said to be left | largest change [counts] |",
        "|---|---|---|---|",
    ]
    for name in SIMULATORS.values():
        mine = [row for row in rows if row["simulator"] == name and not row["problem"]]
        left = [row["matters"] or row["changing"] for row in mine]
        largest = max((row["counts"] for row in mine if row["found"]), default=0.0)
        lines.append(
            f"| {name} | {percent(rate(row['found'] for row in mine))} | {percent(rate(left))} | {largest:.2g} |"
        )
    return "\n".join(lines) + "\n"


def main(
    rigs: Annotated[int, typer.Option(help="Rigs of each simulator.", min=1)] = 100,
    seed: Annotated[int, typer.Option(help="Another one draws other rigs.", min=0)] = 21,
    jobs: Annotated[int, typer.Option(help="Processes.", min=1)] = 2,
    backend: Annotated[str, typer.Option(help="loky or dask.")] = "loky",
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder to write to.")] = Path("out/empty_rigs"),
) -> None:
    """Count how often something is said to be left on empty rigs."""
    with explained(), workers(backend, jobs):
        trials = plan(rigs, seed)
        rows: list[dict[str, Any]] = list(finished([delayed(examined)(trial) for trial in trials], "rigs"))
        write_whole(output / "empty_rigs.csv", pd.DataFrame(rows).to_csv(index=False))
        typer.echo(table(rows))
        if lost := [row for row in rows if row["problem"]]:
            typer.echo(f"not counted: {len(lost)} ({lost[0]['problem']})")


if __name__ == "__main__":
    typer.run(main)
