"""The likelihood of hard friction: steps are long where it is constant, and as exact as very short ones."""

from __future__ import annotations

import numpy as np
import pytest

from furuta_gym import simulate
from furuta_gym.plant import QUBE
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import open_loop
from identification.estimation.prediction_error import PredictionError, quietest
from identification.kalman.coordinates import plant_coordinates
from identification.kalman.noise_model import Noise
from identification.kalman.record import Record
from identification.logs.log import Log

SECONDS, FINER = 6.0, 0.025  # steps of 0.05 ms


def swings(seed: int, t: np.ndarray) -> np.ndarray:
    rng = np.random.default_rng(seed)
    last, size, phase = 2.5 + rng.uniform(0, 1), 0.4 + 0.1 * rng.uniform(), rng.uniform()
    return size * QUBE.u_max * np.sin(2 * np.pi * (0.3 * t + (last - 0.3) * t**2 / 20 + phase))


def pushes(seed: int, t: np.ndarray) -> np.ndarray:
    """From one side to the other: the arm stops in between."""
    rng = np.random.default_rng(seed)
    return 0.2 * QUBE.u_max * np.sign(np.sin(2 * np.pi * (0.4 + 0.3 * rng.uniform()) * t + rng.uniform()))


@pytest.mark.parametrize(
    ("r", "effect", "command", "seed"),
    [  # the first six hold stops that the ends of a step do not show
        (1e4, "", swings, 16),
        (1e4, "arm_position_friction", swings, 15),
        (1e4, "input_offset", swings, 6),
        (1e4, "input_offset", swings, 9),
        (1e4, "arm_stribeck", pushes, 4),
        (1e4, "arm_stribeck", pushes, 16),
        (300.0, "", pushes, 1),
    ],
)
def test_a_likelihood_is_that_of_very_short_steps(r, effect, command, seed):
    """Within half a nat: names differ by ten."""
    plant = QUBE.replace(friction_sharpness=r)
    if effect:
        plant = plant.with_effects(plant.default_effect(effect))
    run = simulate(
        plant,
        open_loop(),
        SECONDS,
        2e-3,
        Sensors(),
        excitation=lambda t: command(seed, t),
        x0=(0.0, np.pi, 0.0, 0.0),
        seed=seed,
        longest_step=5e-5,
    )
    y = run.measured
    log = Log(t=run.t, q1=y[:, 0], q2=y[:, 1], u=run.command, encoder_counts=(4096, 4096), input_unit="V")
    records = [Record.from_log(log)]
    least = quietest(plant, records)
    coordinates = plant_coordinates(plant, free_sharpness=False)
    usual, short = (
        PredictionError(plant, records, coordinates, Noise((float(least[0]), float(least[1])), (0.0, 0.0)), finer)
        for finer in (1.0, FINER)
    )
    z = usual.start()
    assert usual.value(z) == pytest.approx(short.value(z), abs=0.5, rel=0.0)
