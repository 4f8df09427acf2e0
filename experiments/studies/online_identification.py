"""On-line identification beside the batch methods: `python -m experiments.studies.online_identification`.

The paper's "further research": recursive least squares with and without forgetting, and an extended Kalman filter over
joints and parameters, on the same simulated logs as the two batch methods. One log is of a plant that stays as it is,
one of a plant whose pendulum becomes heavier half way. Writes plots of θ̂ over time and online_identification.json.
"""

from __future__ import annotations

import time
import warnings
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray

from experiments.cli.errors import explained
from experiments.cli.output import write_json
from experiments.studies.identification_benchmark.cases import Case
from furuta_gym.files import whole_file
from furuta_gym.plant import PLANTS, THETA_NAMES, Effect, Plant
from furuta_gym.plant.effects.dispatch import modify_theta
from furuta_gym.plant.layout import N_BASE, THETA_ROWS
from identification.estimation.ekf import track
from identification.estimation.identify import identify
from identification.least_squares.batch import filtered_least_squares
from identification.least_squares.filtered_model import filtered_models
from identification.least_squares.recursive import recursive_least_squares
from identification.logs.log import Log

SCHEMA = "furuta-online-identification/1"
MEMORY = 3.0  # s, of recursive least squares that forgets
WANDER = 0.1  # 1/√s, of the filter's parameters where they may drift
HEAVIER = Effect("payload_step", {"m": 0.3, "t0": 10.0})

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Course:
    """θ̂ over time of one method: t (n,), theta (n, 9), standard deviations (n, 9) or None, microseconds a sample."""

    name: str
    t: Array
    theta: Array
    std: Array | None
    cost_us: float


@dataclass(frozen=True)
class Run:
    """One log with the true θ (n, 9) at its samples, the on-line courses and the batch estimates (9,)."""

    name: str
    log: Log
    truth: Array
    courses: tuple[Course, ...]
    batch: dict[str, Array]


def true_theta(plant: Plant, t: Array) -> Array:
    """θ (n, 9) that acts at times t (n,) [s], effects that change it included."""
    packed = plant.packed()
    P = np.repeat(packed.p[:, None], len(t), axis=1)
    TH = P[:N_BASE].copy()
    modify_theta(np.ascontiguousarray(t), P, packed.codes, TH)
    return TH[THETA_ROWS].T


def follow(case: Case, seed: int, effect: Effect | None = None) -> Run:
    """Simulate a log of the case, its plant with `effect` if one is given, and identify it on line and in batch."""
    setup = case.setup()
    plant = case.plant if effect is None else case.plant.with_effects(effect)
    run = setup.run(case.signal(), seed, plant)
    if run.fell is not None:
        raise RuntimeError(f"{case.name}: the pendulum falls after {run.fell:.2f} s; try another rig")
    log = Log.from_run(run, case.plant.unit, case.counts, case.name)
    return Run(
        "constant" if effect is None else "heavier from half way on",
        log,
        true_theta(plant, run.t),
        tuple(_courses(log, case.T)),
        _batch(log),
    )


def _courses(log: Log, T: float) -> list[Course]:
    found = [
        _recursive("RLS", log, 1.0),
        _recursive(f"RLS, {MEMORY:g} s of memory", log, 1.0 - T / MEMORY),
    ]
    for name, wander in (("EKF", 0.0), ("EKF, θ may drift", WANDER)):
        history = track(log, wander=wander)
        found.append(Course(name, history.t, history.theta, history.std, 1e6 * history.cost_per_sample))
    return found


def _recursive(name: str, log: Log, forgetting: float) -> Course:
    models = filtered_models(log)
    recursive_least_squares(models, forgetting=forgetting)  # compiles
    begun = time.perf_counter()
    history = recursive_least_squares(models, forgetting=forgetting)
    cost = (time.perf_counter() - begun) / len(history.t)
    return Course(name, history.t, history.theta, None, 1e6 * cost)


def _batch(log: Log) -> dict[str, Array]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of bias and the like: here it is shown
        # not by `identify`, which refuses what no plant can have: least squares may well end there
        return {"filtered-ls": filtered_least_squares(log).theta, "prediction-error": identify(log).plant.theta}


def error(theta: Array, truth: Array) -> float:
    """Root mean square relative error of θ̂ over the nine parameters, in %."""
    return float(100.0 * np.sqrt(np.mean(((theta - truth) / truth) ** 2)))


def table(runs: list[Run]) -> str:
    """Final relative errors [%] and cost, in Markdown."""
    header = " | ".join(f"θ{i}" for i in range(1, 10))
    lines = [f"| plant | method | {header} | all | µs a sample |", "|---" * 13 + "|"]
    for run in runs:
        last = [(c.name, c.theta[-1], f"{c.cost_us:.1f}") for c in run.courses]
        last += [(f"{name} (batch)", theta, "") for name, theta in run.batch.items()]
        for name, theta, cost in last:
            off = 100.0 * np.abs(theta - run.truth[-1]) / run.truth[-1]
            cells = " | ".join(f"{x:.2g}" for x in off)
            lines.append(f"| {run.name} | {name} | {cells} | {error(theta, run.truth[-1]):.2g} | {cost} |")
    return "\n".join(lines)


def plot(run: Run, path: Path) -> None:
    """θ̂ / θ over time, a panel for each parameter; the filter's band is two standard deviations."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(3, 3, figsize=(12, 8), sharex=True, layout="constrained")
    first = run.truth[0]
    for i, ax in enumerate(axes.flat):
        for c, color in zip(run.courses, ("tab:orange", "tab:red", "tab:blue", "tab:cyan"), strict=True):
            ax.plot(c.t, c.theta[:, i] / first[i], color=color, lw=1.2, label=c.name)
            if c.std is not None:
                low, high = ((c.theta[:, i] + s * c.std[:, i]) / first[i] for s in (-2.0, 2.0))
                ax.fill_between(c.t, low, high, color=color, alpha=0.15, lw=0)
        for (name, theta), style in zip(run.batch.items(), (":", "--"), strict=True):
            ax.axhline(theta[i] / first[i], color="k", ls=style, lw=1, label=f"{name} (batch)")
        ax.plot(run.log.t, run.truth[:, i] / first[i], color="tab:green", lw=2, alpha=0.6, label="true")
        ax.set_ylim(0.0, 2.2)
        ax.set_title(f"θ{i + 1}", fontsize=10)
    for ax in axes[-1]:
        ax.set_xlabel("t [s]")
    for ax in axes[:, 0]:
        ax.set_ylabel("θ̂ over θ at the start")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, fontsize=9)
    figure.suptitle(f"{run.log.source}: {run.name}", fontsize=11)
    with whole_file(path) as new:
        figure.savefig(new, dpi=110)
    plt.close(figure)


def main(
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for plots, table and JSON.")] = Path("out"),
    rig: Annotated[str, typer.Option(help="table3, qube or large.")] = "qube",
    sample_time: Annotated[float, typer.Option(help="In milliseconds.", min=0.1)] = 2.0,
    counts: Annotated[int, typer.Option(help="Encoder counts per revolution.", min=100)] = 4096,
    seed: Annotated[int, typer.Option(help="Of the torque noise.", min=0)] = 0,
) -> None:
    """Follow θ on line on two simulated logs of 20 s, and compare with the batch methods."""
    with explained():
        if rig not in PLANTS:
            raise ValueError(f"--rig {rig}: expected one of {', '.join(PLANTS)}")
        case = replace(Case(rig, 1e-3 * sample_time, counts), duration=20.0)
        runs = [follow(case, seed), follow(case, seed, HEAVIER)]
        output.mkdir(parents=True, exist_ok=True)
        for run, name in zip(runs, ("constant", "heavier"), strict=True):
            plot(run, output / f"online_{name}.png")
        write_json(output / "online_identification.json", to_json(runs))
        typer.echo(table(runs))


def to_json(runs: list[Run]) -> dict:
    """Final estimates and costs by name."""

    def named(theta: Array) -> dict[str, float]:
        return dict(zip(THETA_NAMES, map(float, theta), strict=True))

    return {
        "schema": SCHEMA,
        "runs": [
            {
                "log": run.log.source,
                "plant": run.name,
                "truth": named(run.truth[-1]),
                "online": [
                    {"method": c.name, "theta": named(c.theta[-1]), "us_per_sample": c.cost_us} for c in run.courses
                ],
                "batch": {name: named(theta) for name, theta in run.batch.items()},
            }
            for run in runs
        ],
    }


if __name__ == "__main__":
    typer.run(main)
