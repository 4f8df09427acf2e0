"""The estimators side by side: a log in, θ̂ (9,) and its standard deviations (9,) out, from the log alone."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from identification.identify import identify
from identification.least_squares import filtered_least_squares
from identification.logs import Log
from identification.online_ekf import track
from identification.recursive import recursive_least_squares
from identification.regression import filtered_models

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
    from .mujoco_windows import fit

    return fit(log)


METHODS: dict[str, Callable[[Log], Answer]] = {
    "prediction-error": prediction_error,
    "filtered-ls": filtered_ls,
    "recursive-ls": recursive_ls,
    "ekf": ekf,
    "mujoco-windows": mujoco_windows,
}
