"""The record beside a policy: how it was made, and what it can do."""

import json
import platform
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from furuta_gym.files import write_whole

from .conditions import conditions
from .curriculum import Evaluation, reached
from .design import choose_sensors
from .evaluation import trial_period
from .recipes import discount
from .registry import make_controller
from .training_setup import Training

TRIALS = 200  # of the evaluation
DURATION = 10.0  # s of a trial; a swing-up has 15
OTHER_SEED = 1_000_000  # episodes that choose a network are not those that train it
FINAL_SEED = 2_000_000  # and those that judge the chosen one are new again


def record_of(
    training: Training,
    *,
    command: str | None,
    steps: int,
    resumed_at: list[int],
    evaluations: Sequence[Evaluation],
    best_return: float | None,
    spent: Mapping[str, float],
) -> dict[str, Any]:
    """Everything but the trials at the end. steps: done in all; resumed_at: steps at which a run was gone on with;
    evaluations: on the way; spent: wall and CPU seconds of the last sitting; best_return: mean return that chose the
    network."""
    plan, setup = training.recipe, training.setup
    return training.identity | {
        "command": command,
        "env": training.identity["env"] | {"velocity_cutoff": setup.sensors.velocity_cutoff},
        "not_trained_for": training.not_trained_for,
        "seed": training.seed,
        "steps": steps,
        "resumed_at": resumed_at,
        "settings": {
            "envs": plan.envs,
            "reward_scale": plan.reward_scale,
            "net_arch": list(plan.layers),
            "cells": plan.cells,
            "activation": plan.activation,
            "log_std_init": plan.log_std,
            "gamma": discount(setup.sample_time),
            "last_rate": plan.last_rate,
            "episode": plan.episode,
        }
        | dict(plan.settings),
        "best_return": best_return,
        "level": reached(training.curriculum, evaluations),
        "evaluations": [e.to_dict() for e in evaluations],
        "spent": dict(spent),
        "versions": versions(),
        "plant": training.plant.to_dict(),
    }


def evaluate(policy: Path, training: Training) -> dict[str, Any]:
    """Figures with intervals of `TRIALS` trials of the task on the nominal plant, as `furuta compare` plays them."""
    seed, plant = training.seed + FINAL_SEED, training.plant
    T, sensors = trial_period(plant, None, [str(policy)]), choose_sensors(plant, None)
    row = conditions(plant, sensors, TRIALS, 1, DURATION, (training.task,), seed=seed)[0]
    figures = row.score(make_controller(policy, plant, T, sensors), T, seed)
    settings = {"trials": TRIALS, "sample_time": T, "seed": seed}
    return settings | {name: interval.to_dict() for name, interval in figures.items()}


def versions() -> dict[str, str]:
    """Of Python and of the packages that a training run depends on."""
    packages = ("furuta-gym", "stable-baselines3", "sb3-contrib", "torch", "gymnasium", "numpy")
    found = {"python": platform.python_version()}
    for package in packages:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found


def write_record(path: Path, record: Mapping[str, Any]) -> None:
    """Write it as JSON."""
    text = json.dumps(record, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    write_whole(path, text)
