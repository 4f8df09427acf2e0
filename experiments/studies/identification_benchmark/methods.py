"""The estimators side by side: a log in, θ̂ (9,) and its standard deviations (9,) out, from the log alone."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from identification.estimation.ekf import track
from identification.estimation.identify import identify
from identification.least_squares.batch import filtered_least_squares
from identification.least_squares.filtered_model import filtered_models
from identification.least_squares.recursive import recursive_least_squares
from identification.logs.log import Log

Answer = tuple[NDArray[np.float64], NDArray[np.float64]]


def prediction_error(log: Log) -> Answer:
    found = identify(log)
    return found.values[:9], found.std[:9]


def filtered_ls(log: Log) -> Answer:
    found = filtered_least_squares([log])
    return found.theta, found.std


def recursive_ls(log: Log) -> Answer:
    """With forgetting 0.9999 a sample; without it the last estimate is that of filtered-ls."""
    theta = recursive_least_squares(filtered_models([log]), forgetting=0.9999).last
    return theta, np.full(9, np.nan)


def ekf(log: Log) -> Answer:
    history = track(log)
    return history.last, history.std[-1]


def mujoco_windows(log: Log) -> Answer:
    from experiments.studies.identification_benchmark.mujoco_windows import fit

    return fit(log)


METHODS: dict[str, Callable[[Log], Answer]] = {
    "prediction-error": prediction_error,
    "filtered-ls": filtered_ls,
    "recursive-ls": recursive_ls,
    "ekf": ekf,
    "mujoco-windows": mujoco_windows,
}
