"""How large an error on a log the error bars of a plant alone let one expect."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from furuta_gym.plant import Plant
from furuta_gym.plant.sampling import sampled_plants

from ..estimation.informative import informative
from ..estimation.zeros import aligned
from ..kalman.noise import fit_noise
from ..kalman.record import stretches
from ..logs.log import Log
from .free_run import Windows, free_run
from .gap import Gap
from .predicted import SETTLE

ENOUGH = 20_000
"""Samples that are predicted, of longer logs the most informative stretches."""
DRAWS = 30
"""Plants drawn from the covariance."""
_SEED = 0
_WITHIN = 3.84
"""Of the squared error above the floor: up to so many times the expected one is explained (χ² of one parameter)."""


def expected_ratio(plant: Plant, logs: Sequence[Log], gap: Gap) -> float | None:
    """Error over the noise floor that a plant of these error bars has on average, if its equations are right.

    Plants are drawn from the covariance and run freely from the states that the plant's own filter finds. How far they
    end from the plant itself is how far it ends from the rig; runs that leave all bounds are left out. gap: of the
    plant on these logs. None without a covariance, and where no drawn plant is possible or follows a log.
    """
    if plant.covariance is None:
        return None
    part = informative(logs, ENOUGH)
    apart = []
    try:
        plants = list(sampled_plants(plant, DRAWS, np.random.default_rng(_SEED)))
        for stretch in stretches(aligned(plant, logs if part is None else part.logs).logs):
            record = stretch.record
            if not Windows.fit_into(record.t, (gap.horizon,), SETTLE):
                continue
            path = fit_noise(plant, record).path
            windows = Windows.over(record.t, (gap.horizon,), SETTLE)
            own = free_run(path, windows)[:, -1]
            with np.errstate(invalid="ignore"):  # of two runs that both leave all bounds
                ends = [free_run(replace(path, plant=drawn), windows)[:, -1] - own for drawn in plants]
            apart += [end[np.isfinite(end).all(axis=1)] for end in ends]
    except ValueError:
        return None
    if not sum(map(len, apart)):
        return None
    squares = np.mean(np.concatenate(apart) ** 2, axis=0)
    return float(np.sqrt(np.mean(1.0 + squares / gap.floor**2)))


def told(ratio: float, expected: float) -> str:
    """What that says beside an error of `ratio` times the noise floor; empty where it explains little."""
    if ratio**2 - 1.0 > _WITHIN * (expected**2 - 1.0):
        return ""
    return (
        f"but the error bars of this plant's parameters alone let one expect {expected:.2g} times: they are too wide "
        "to predict these logs. If the plant is adequate on its own logs, nothing need be missing: fit all together"
    )
