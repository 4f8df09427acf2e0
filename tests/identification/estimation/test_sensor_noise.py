"""The encoder noise that a fit writes into the plant file, for envs, observers and designs."""

from __future__ import annotations

import numpy as np
import pytest

from furuta_gym.plant import QUBE
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import open_loop, simulate
from identification.design.signals import Chirp
from identification.estimation.identify import identify
from identification.logs.log import Log

COUNTS = (2048, 4096)


def sensors(noise_std: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """noise_std of the plant file, and the reading noise of the fit."""
    run = simulate(
        QUBE,
        open_loop(),
        8.0,
        0.004,
        Sensors(COUNTS, noise_std),
        excitation=Chirp(3.0, 0.5, 4.0, 8.0),
        x0=(0.0, np.pi, 0.0, 0.0),
        torque_noise=(1e-7, 1e-9),
    )
    found = identify(Log.from_run(run, QUBE.unit, COUNTS), QUBE)
    assert found.noise is not None
    assert found.plant.sensors is not None
    return np.array(found.plant.sensors["noise_std"]), np.array(found.noise.reading_std[0])


def test_noise_beside_rounding_is_that_of_each_encoder() -> None:
    noise, total = sensors((8e-4, 2e-3))
    assert noise == pytest.approx([8e-4, 2e-3], rel=0.2)
    quantum = 2.0 * np.pi / np.array(COUNTS)
    assert noise**2 == pytest.approx(total**2 - quantum**2 / 12.0, rel=1e-9)


def test_rounding_alone_is_no_noise_beside_it() -> None:
    noise, _ = sensors((0.0, 0.0))
    assert np.all(noise < 0.3 * np.array([2.0 * np.pi / c for c in COUNTS]) / 12**0.5 + 1e-4)
