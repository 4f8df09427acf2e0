"""Is a rig that changed between two logs told from an effect, and are logs of one rig left alone?

`python -m experiments.studies.changed_rigs` records two logs of the bench: of one rig, or of two of its kind, whose
masses, lengths and frictions differ. `diagnose` gets both together, or one of them held out. Writes changed_rigs.csv,
and prints what was said.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import product
from pathlib import Path
from typing import Annotated, Any

import pandas as pd
import typer
from joblib import delayed

from experiments.bench import HiddenEffect, Rig, record
from experiments.cli.errors import explained
from experiments.studies.finished import finished
from experiments.trials.report import percent
from experiments.trials.summary import rate
from experiments.workers import workers
from furuta_gym.files import write_whole
from identification import Log, diagnose

KINDS = ("table3", "servo", "workshop", "desk")
HIDDEN = ("", "arm_spring", "input_delay")
SCATTER = 0.08  # of each constant, between two rigs of a kind


@dataclass(frozen=True)
class Case:
    """Two logs. hidden: the effect in both, "" for none. changed: whether the second is of another rig of the kind.
    held_out: whether the second is held out, or searched with the first."""

    kind: str
    hidden: str
    changed: bool
    held_out: bool
    seed: int

    def logs(self, duration: float = 10.0) -> tuple[Log, Log]:
        """Both, of two kinds of motion."""
        effects = (HiddenEffect(self.hidden, form="table"),) if self.hidden else ()
        found = []
        for i, experiment in enumerate(("paper", "wide")):
            rig = Rig(self.kind, effects, individual=self.seed + (1000 + i if self.changed else 0), scatter=SCATTER)
            run = record(rig, experiment, self.seed + i, duration)
            counts = rig.counts
            unit = rig.kind.unit
            found.append(Log(run.t, run.q1, run.q2, run.u, unit, encoder_counts=counts, source=f"{experiment}.csv"))
        return found[0], found[1]


def asked(case: Case, duration: float = 10.0, only: Sequence[str] | None = None) -> dict[str, Any]:
    """What `diagnose` says. only: effects of the library that it may name."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # advice for a person
        first, second = case.logs(duration)
        found = diagnose(first, second, only=only) if case.held_out else diagnose([first, second], only=only)
    return asdict(case) | {
        "verdict": found.verdict,
        "named": " ".join(sorted(effect.name for effect in found.named)),
        "said_to_differ": found.different is not None,
        "differ": " ".join(f"{name}:{factor:.3g}" for name, factor in found.different.factors.items())
        if found.different
        else "",
        "seconds": round(found.runtime_s, 1),
    }


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Markdown: how often logs were said to be of different plants, and what was named."""
    lines = ["| the second log | it is | said to differ | right names and no other |", "|---|---|---|---|"]
    for changed, held_out in product((False, True), repeat=2):
        mine = [row for row in rows if (row["changed"], row["held_out"]) == (changed, held_out)]
        if not mine:
            continue
        lines.append(
            f"| of {'another' if changed else 'the same'} rig | {'held out' if held_out else 'searched'} | "
            f"{percent(rate(row['said_to_differ'] for row in mine))} | "
            f"{percent(rate(row['named'] == row['hidden'] for row in mine))} |"
        )
    return "\n".join(lines) + "\n"


def main(
    seeds: Annotated[int, typer.Option(help="Rigs of each kind, with each effect.", min=1)] = 1,
    seed: Annotated[int, typer.Option(help="Of the first; another one draws other rigs.", min=0)] = 1,
    jobs: Annotated[int, typer.Option(help="Processes.", min=1)] = 2,
    backend: Annotated[str, typer.Option(help="loky or dask.")] = "loky",
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder to write to.")] = Path("out/changed_rigs"),
) -> None:
    """Count how often a changed rig is told from an effect."""
    with explained(), workers(backend, jobs):
        ways = product(range(seed, seed + seeds), KINDS, HIDDEN, (True, False), (True, False))
        cases = [Case(kind, hidden, changed, held_out, n) for n, kind, hidden, changed, held_out in ways]
        rows: list[dict[str, Any]] = []
        for row in finished([delayed(asked)(case) for case in cases], "diagnoses"):
            rows.append(row)
            write_whole(output / "changed_rigs.csv", pd.DataFrame(rows).to_csv(index=False))
        typer.echo(table(rows))


if __name__ == "__main__":
    typer.run(main)
