"""The bench's rigs that hide an effect in the studies on retraining, and what is made for and done with them."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from controllers import make_controller
from controllers.training.train import Training, train
from experiments.bench import HiddenEffect, Rig, record
from experiments.bench_runs import FIGURES, SWING_UP, SWING_UP_FIGURES, Run, run_on_bench, swing_up_on_bench
from furuta_gym.plant import Plant
from identification.logs.log import Log
from identification.logs.reading import read_log

LEARNED = "ppo"


def _rig(kind: str, effect: HiddenEffect, individual: int, name: str) -> Rig:
    return Rig(kind, [effect], individual=individual, scatter=0.08, name=name)


# Chosen before any of them was run: one effect each in the command, at the joint and on the arm, several times the size
# that is plain to see, each by the bench's own law where it has one. Rigs of two units and three kinds.
RIGS = {
    "late": _rig("servo", HiddenEffect("input_delay", 3.0), 11, "late"),
    "dead zone": _rig("workshop", HiddenEffect("input_dead_zone", 3.0), 12, "dead zone"),
    "cable": _rig("table3", HiddenEffect("arm_spring", 2.0), 13, "cable"),
}

# Large enough to spoil designs made without them, as three runs each with the true constants had shown before.
SWING_UP_RIGS = {
    "late": _rig("servo", HiddenEffect("input_delay", parameters={"d": 0.016}), 11, "late"),
    "dead zone": _rig("workshop", HiddenEffect("input_dead_zone", parameters={"w": 0.8}), 12, "dead zone"),
    "cable": _rig("table3", HiddenEffect("arm_spring", parameters={"k": 2.0, "q1n": 0.3}), 13, "cable"),
}


@dataclass(frozen=True)
class Task:
    """What is asked of controllers on the bench.

    designs: names of `CONTROLLERS`. figures: of a `Run`, which are compared. duration [s] of a run; runs of each
    controller; steps of each training, which has `training` besides.
    """

    name: str
    rigs: Mapping[str, Rig]
    designs: tuple[str, ...]
    figures: tuple[str, ...]
    duration: float
    runs: int
    steps: int
    training: Mapping[str, Any]

    def play(self, rig: Rig, controller: Any, seed: int, duration: float) -> Run:
        """One run on the bench."""
        if self.name == "balance":
            return run_on_bench(rig, controller, seed, duration)
        return swing_up_on_bench(rig, controller, seed, duration, min(5.0, duration / 3))

    def learned(self, plant: Plant, path: Path, seed: int, steps: int) -> Any:
        """A policy learned on `plant`. Several observations with the last command show it a delay, if there is one."""
        train(Training(plant, self.name, LEARNED, steps, seed, observe_command=True, **self.training), path)
        return make_controller(path, plant, plant.sample_time)


TASKS = {
    "balance": Task("balance", RIGS, ("lqr", "lqg", "lqg-friction"), FIGURES, 6.0, 10, 300_000, {"history": 3}),
    "swing_up": Task(
        "swing_up", SWING_UP_RIGS, ("swing-up",), SWING_UP_FIGURES, SWING_UP, 20, 2_000_000, {"history": 6}
    ),
}


def task_named(name: str) -> Task:
    """One of `TASKS`. Raises ValueError for another name."""
    if name not in TASKS:
        raise ValueError(f"--task {name!r}: expected one of {', '.join(TASKS)}")
    return TASKS[name]


def recorded(rig: Rig, experiments: tuple[str, ...], duration: float, seed: int = 0) -> list[Log]:
    """Logs of `duration` seconds as files tell them, and nothing else."""
    logs = []
    with tempfile.TemporaryDirectory() as folder:
        for i, experiment in enumerate(experiments):
            run = record(rig, experiment, seed=seed + i, duration=duration)
            logs.append(read_log(run.write(Path(folder) / f"{experiment}.csv")))
    return logs


def as_the_lab_knows(plant: Plant, rig: Rig) -> Plant:
    """With the supply and the sample time, which a lab knows and a log does not tell."""
    return plant.replace(u_max=rig.kind.u_max, sample_time=rig.period)
