"""How often does `furuta changes` call an unchanged rig changed, and how often does it see a change?

`python -m experiments.studies.two_plants` records logs on the bench before and after: of the same rig, and of the rig
with a heavier pendulum, more friction in the arm, or a weaker supply. Model (5) is fitted to each log. Writes
two_plants.csv, and prints how often something was said to have changed.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any

import numpy as np
import pandas as pd
import typer
from joblib import delayed

from experiments.bench import SETS, ParameterSet, Rig, record
from experiments.cli.errors import explained
from experiments.studies.finished import finished
from experiments.trials.report import percent
from experiments.trials.summary import rate
from experiments.workers import workers
from furuta_gym.files import write_whole
from furuta_gym.plant import THETA_NAMES, Plant
from identification import Log, identify
from identification.validation.plant_changes import plant_change

KINDS = ("table3", "servo", "workshop", "desk")
SCATTER = 0.08  # of each constant, between two rigs of a kind


def heavier(s: ParameterSet) -> ParameterSet:
    """The pendulum 5 % heavier. Of a uniform rod, m2 L1² = 4 θ3² / (3 θ4)."""
    th1, th2, th3, th4, th5 = s.inertia
    added = 0.05 * min(4.0 * th3**2 / (3.0 * th4), th1)
    return replace(s, inertia=(th1 + added, 1.05 * th2, 1.05 * th3, 1.05 * th4, 1.05 * th5))


def stiffer(s: ParameterSet) -> ParameterSet:
    """The arm's friction 20 % larger."""
    return replace(s, viscous=(1.2 * s.viscous[0], s.viscous[1]), coulomb=(1.2 * s.coulomb[0], s.coulomb[1]))


def weaker(s: ParameterSet) -> ParameterSet:
    """A supply 5 % lower: all torques in units of the command are larger by that."""
    up = 1.0 / 0.95
    scaled: dict[str, Any] = {n: tuple(up * v for v in getattr(s, n)) for n in ("inertia", "viscous", "coulomb")}
    return replace(s, weight_moment=up * s.weight_moment, **scaled)


CHANGES: Mapping[str, Callable[[ParameterSet], ParameterSet]] = MappingProxyType(
    {
        "nothing": lambda s: s,
        "pendulum 5 % heavier": heavier,
        "arm's friction 20 % larger": stiffer,
        "supply 5 % weaker": weaker,
    }
)


def fitted(constants: ParameterSet, seed: int, duration: float) -> Plant:
    """Model (5) by maximum likelihood to a log of the paper's experiment."""
    rig = Rig(constants, engine="lagrange")
    run = record(rig, "paper", seed, duration)
    log = Log(run.t, run.q1, run.q2, run.u, constants.unit, encoder_counts=rig.counts, source=f"paper {seed}")
    return identify(log).plant


def asked(kind: str, number: int, duration: float = 12.0) -> list[dict[str, Any]]:
    """One rig: what is said of each change."""
    rows = []
    constants = replace(SETS[kind].individual(number, SCATTER), bodies=None)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # advice for a person
        before = fitted(constants, 2 * number, duration)
        for name, change in CHANGES.items():
            after = fitted(change(constants), 2 * number + 1, duration)
            found = plant_change(before, after)
            certain = [d.name for d in found.certain]
            rows.append(
                {
                    "kind": kind,
                    "number": number,
                    "changed": name,
                    "said": found.changed,
                    "certain": " ".join(certain),
                    "p": found.p,
                    "one_factor": found.one_factor,
                    "r_before": before.friction_sharpness,
                    "r_after": after.friction_sharpness,
                    "largest_θ_deviation": max(abs(d.sure) for d in found.differences if d.name in THETA_NAMES),
                }
            )
    return rows


def table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Markdown: how often a change was told, and which parameters it was seen in."""
    lines = ["| changed | called a change | in half of the rigs or more by |", "|---|---|---|"]
    for name in CHANGES:
        mine = [row for row in rows if row["changed"] == name]
        if not mine:
            continue
        seen = [str(row["certain"]).split() for row in mine]
        names = [n for n in THETA_NAMES if np.mean([n in own for own in seen]) >= 0.5]
        factor = np.mean([row["one_factor"] is not None for row in mine])
        by = ", ".join(n.replace("theta", "θ") for n in names) + ("; one factor of all θ" if factor >= 0.5 else "")
        lines.append(f"| {name} | {percent(rate(bool(row['said']) for row in mine))} | {by or '–'} |")
    return "\n".join(lines) + "\n"


def main(
    rigs: Annotated[int, typer.Option(help="Rigs of each of four kinds.", min=1)] = 10,
    seed: Annotated[int, typer.Option(help="Of the first; another one draws other rigs.", min=0)] = 1,
    jobs: Annotated[int, typer.Option(help="Processes.", min=1)] = 2,
    backend: Annotated[str, typer.Option(help="loky or dask.")] = "loky",
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder to write to.")] = Path("out/two_plants"),
) -> None:
    """Count how often two plants of a rig are said to differ."""
    with explained(), workers(backend, jobs):
        cases = [(kind, number) for number in range(seed, seed + rigs) for kind in KINDS]
        rows: list[dict[str, Any]] = []
        for found in finished([delayed(asked)(*case) for case in cases], "rigs"):
            rows += found
            write_whole(output / "two_plants.csv", pd.DataFrame(rows).to_csv(index=False))
        typer.echo(table(rows))


if __name__ == "__main__":
    typer.run(main)
