"""What simulated encoders do to an angle."""

from __future__ import annotations

import numpy as np
import pytest

from furuta_gym.plant import QUBE, TABLE_3
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import LivePlant, open_loop, simulate

COUNTS = (2048, 512)


def test_encoders_round_to_the_nearest_count() -> None:
    step = 2.0 * np.pi / np.array(COUNTS)
    run = simulate(QUBE, open_loop(), 4.0, 0.002, Sensors(COUNTS), x0=(0.3, 2.0, 3.0, 0.0))
    error = (run.measured - run.state[:, :2]) / step
    assert np.abs(error).max() <= 0.5 + 1e-9
    assert np.abs(error[:, 1]).max() > 0.45
    assert abs(error[:, 1].mean()) < 0.1


def test_noise_is_counted_as_well() -> None:
    step = 2.0 * np.pi / np.array(COUNTS)
    run = simulate(QUBE, open_loop(), 4.0, 0.002, Sensors(COUNTS, noise_std=1e-3), x0=(0.3, 2.0, 3.0, 0.0))
    assert run.measured / step == pytest.approx(np.round(run.measured / step), abs=1e-6)
    assert np.std((run.measured - run.state[:, :2])[:, 0]) == pytest.approx(np.hypot(1e-3, step[0] / 12**0.5), rel=0.1)


def test_a_torque_from_outside_acts_by_the_mass_matrix() -> None:
    free = TABLE_3.replace(theta=[*TABLE_3.theta[:5], 0.0, 0.0, 0.0, 0.0])
    torque, T = np.array([0.3, -0.01]), 1e-4
    live = LivePlant(free, T, x0=(0.0, np.pi, 0.0, 0.0))
    live.step(0.0, torque)
    th1, _, th3, th4 = free.theta[:4]
    mass = np.array([[th1, -th3], [-th3, th4]])  # cos q2 = -1 where it hangs
    assert live.state[2:] / T == pytest.approx(np.linalg.solve(mass, torque), rel=1e-3)


@pytest.mark.parametrize("T", [0.002, 0.01])
def test_torque_noise_has_the_intensity_that_is_asked_for(T: float) -> None:
    """An arm without coupling and friction integrates white torque."""
    arm = TABLE_3.replace(theta=[TABLE_3.theta[0], 0.0, 0.0, *TABLE_3.theta[3:5], 0.0, 0.0, 0.0, 0.0])
    run = simulate(arm, open_loop(), 4000 * T, T, x0=(0.0, np.pi, 0.0, 0.0), torque_noise=(1e-6, 0.0))
    assert np.diff(run.state[:, 2]).var() / T == pytest.approx(1e-6 / arm.theta[0] ** 2, rel=0.15)
