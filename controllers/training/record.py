"""The record beside a policy: how it was made, and what it can do."""

import json
import platform
from collections.abc import Mapping
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from furuta_gym.files import write_whole

from ..comparison.conditions import nominal
from ..comparison.evaluation import trial_period
from ..comparison.seeds import FINAL_SEED
from ..design import choose_sensors
from ..registry import make_controller
from .recipes import discount
from .setup import Training

TRIALS = 200  # of the evaluation
DURATION = 10.0  # s of a trial; a swing-up has 15


def record_of(training: Training, command: str | None, progress: Mapping[str, Any], level: float) -> dict[str, Any]:
    """Everything but the trials at the end. progress: how far the run is, see `resuming.Progress`; level: of the last
    evaluation."""
    plan, setup = training.recipe, training.setup
    return training.identity | {
        "command": command,
        "env": training.identity["env"] | {"velocity_cutoff": setup.sensors.velocity_cutoff},
        "not_trained_for": training.not_trained_for,
        "drawn_otherwise": training.drawn_otherwise,
        "seed": training.seed,
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
        **progress,
        "level": level,
        "versions": versions(),
        "plant": training.plant.to_dict(),
    }


def evaluate(policy: Path, training: Training) -> dict[str, Any]:
    """Figures with intervals of `TRIALS` trials of the task on the nominal plant, as `furuta compare` plays them.

    The arm must stay within the limit that it was trained with."""
    seed, plant = training.seed + FINAL_SEED, training.plant
    T, sensors = trial_period(plant, None, [str(policy)]), choose_sensors(plant, None)
    row = replace(nominal(plant, sensors, training.task, TRIALS, DURATION), arm_travel=training.setup.arm_limit)
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
