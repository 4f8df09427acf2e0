"""Does it pay to train on drawn plants? `python -m experiments.studies.randomized_training`.

A rig of the bench is recorded and identified as model (5), which misses what the rig hides. Policies are trained
on that plant alone, on plants drawn from its covariance, and on drawn plants with effects that come and go; all see
the same observations. They balance plants drawn from the covariance, plants with each θ off by 20 %, and the rig.
`--task swing_up` is `randomized_swing_up`.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from controllers import make_controller
from controllers.comparison.conditions import conditions
from controllers.comparison.statistics import Interval, success_rate, typical
from controllers.comparison.trials import Outcome
from controllers.design import choose_sensors
from controllers.training.train import Training, train
from experiments.bench_runs import run_on_bench
from experiments.cli.errors import explained
from experiments.studies import randomized_swing_up
from experiments.studies.hidden_rigs import RIGS, as_the_lab_knows, recorded, task_named
from furuta_gym.files import write_whole
from furuta_gym.plant import Plant
from identification.estimation.identify import identify

SCHEMA = "furuta-randomized-training/1"
CHANCES = {"input_delay": 0.3, "input_dead_zone": 0.3, "arm_spring": 0.3}
KINDS: dict[str, dict[str, Any]] = {
    "nominal": {},
    "drawn": {"randomize": True},
    "drawn, with effects": {"randomize": True, "effect_probabilities": CHANCES},
}
SEED = 40_000  # of the trials; training has seeds 0 and 1


@dataclass(frozen=True)
class Size:
    """policies of `steps` env steps for each kind; trials on drawn plants, runs of `duration` seconds on the rig."""

    rig: str = "late"
    policies: int = 2
    steps: int = 300_000
    trials: int = 100
    runs: int = 10
    duration: float = 6.0

    @classmethod
    def quick(cls) -> Size:
        """Small enough for a test."""
        return cls(policies=1, steps=30_000, trials=5, runs=1, duration=1.0)


def run(size: Size, out: Path, say: Callable[[str], None] = print) -> dict[str, dict[str, dict[str, Interval]]]:
    """scores[kind][where][figure]; where: "drawn plants", "θ ±20 %", "the rig". Policies and results.json go to `out`.

    Raises ValueError if `out` holds a plant file already.
    """
    if (out / "rig.json").exists():
        raise ValueError(f"{out} holds an earlier run; remove it or choose another --out")
    rig = RIGS[size.rig]
    say("recording and identifying")
    plant = as_the_lab_knows(identify(recorded(rig, ("paper",), 10.0)).plant, rig)
    out.mkdir(parents=True, exist_ok=True)
    plant.save(out / "rig.json")
    scores = {}
    for kind, options in KINDS.items():
        policies = []
        for seed in range(size.policies):
            say(f"{kind}: training policy {seed + 1} of {size.policies}")
            path = out / f"{kind.replace(', ', '-').replace(' ', '-')}-{seed}.zip"
            train(Training(plant, steps=size.steps, seed=seed, history=3, observe_command=True, **options), path)
            policies.append(make_controller(path, plant, rig.period))
        say(f"{kind}: trials")
        scores[kind] = _on_plants(plant, policies, size)
        runs = [
            run_on_bench(rig, policy, SEED + 1000 * k + i, size.duration)
            for k, policy in enumerate(policies)
            for i in range(size.runs)
        ]
        won = [r.rms_q2 for r in runs if r.success]
        scores[kind]["the rig"] = {"success": success_rate([r.success for r in runs]), "rms_q2": typical(won)}
    result = {
        kind: {where: {figure: x.to_dict() for figure, x in figures.items()} for where, figures in rows.items()}
        for kind, rows in scores.items()
    }
    text = json.dumps({"schema": SCHEMA, "size": asdict(size), "scores": result}, ensure_ascii=False, indent=2)
    write_whole(out / "results.json", text + "\n")
    return scores


def _on_plants(plant: Plant, policies: list[Any], size: Size) -> dict[str, dict[str, Interval]]:
    """The trials of `furuta compare --groups parameters`, all policies of a kind together.

    Each policy meets plants, starts and noise of its own, so that no trial counts twice."""
    T = plant.sample_time
    assert T is not None
    sensors = choose_sensors(plant, None)
    names = {"θ as uncertain as identified": "drawn plants", "θ ±20 %": "θ ±20 %"}
    outcomes: dict[str, list[Outcome]] = {name: [] for name in names.values()}
    for k, policy in enumerate(policies):
        seed = SEED + 1000 * k
        rows = conditions(plant, sensors, size.trials, size.trials, size.duration, ("parameters",), seed=seed)
        for row in rows:
            if row.name in names:
                outcomes[names[row.name]].append(row.play(policy, row.starts(seed), T, seed))
    found = {}
    for name, some in outcomes.items():
        success, rms = (np.concatenate([getattr(o, figure) for o in some]) for figure in ("success", "rms_q2"))
        found[name] = {"success": success_rate(success), "rms_q2": typical(rms[success])}
    return found


def main(
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for plants, policies and results.json; default: out/randomized_training/TASK/RIG."),
    ] = None,
    task: Annotated[str, typer.Option(help="balance or swing_up.")] = "balance",
    rig: Annotated[str, typer.Option(help=f"What the rig hides: {', '.join(RIGS)}.")] = "late",
    seeds: Annotated[int | None, typer.Option(help="Trainings of each; default: 2, in swing_up 3.", min=1)] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="One short training each; for a look at what it does.")
    ] = False,
) -> None:
    """Nominal against randomised training, on rigs that differ and on one that hides something."""
    began = time.perf_counter()
    say = Console(stderr=True).print
    with explained():
        if rig not in task_named(task).rigs:
            raise ValueError(f"--rig {rig!r}: expected one of {', '.join(RIGS)}")
        out = out or Path("out/randomized_training") / task / rig.replace(" ", "-")
        if task == "swing_up":
            study = randomized_swing_up
            size = replace(study.Size.quick() if quick else study.Size(), rig=rig)
            shown = study.table(study.run(replace(size, policies=seeds or size.policies), out, say))
        else:
            size = replace(Size.quick() if quick else Size(), rig=rig)
            shown = table(run(replace(size, policies=seeds or size.policies), out, say))
    console = Console()
    console = console if console.is_terminal else Console(width=160)
    console.print(shown)
    console.print(f"{time.perf_counter() - began:.0f} s. Look at: {out / 'results.json'}", highlight=False)


def table(scores: dict[str, dict[str, dict[str, Interval]]]) -> Table:
    """Kind by kind, a pair of columns for each place."""
    shown = Table(title="95 % intervals in brackets; rms q2 [rad] of the successful trials")
    shown.add_column("trained on")
    for where in next(iter(scores.values())):
        shown.add_column(f"{where}\nsuccess [%]", justify="right")
        shown.add_column(f"{where}\nrms q2", justify="right")
    for kind, rows in scores.items():
        cells = []
        for figures in rows.values():
            s = figures["success"]
            cells += [f"{100 * s.value:.3g} [{100 * s.low:.0f}, {100 * s.high:.0f}]", str(figures["rms_q2"])]
        shown.add_row(kind, *cells)
    return shown


if __name__ == "__main__":
    typer.run(main)
