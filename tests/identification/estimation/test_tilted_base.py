"""What a fit makes of a tilted base: gravity gives its moment one sign."""

from __future__ import annotations

import math

import pytest

from furuta_gym.plant import TABLE_3, Effect
from identification.estimation.identify import identify
from identification.estimation.prediction_error import PredictionError, quietest
from identification.kalman.coordinates import plant_coordinates
from identification.kalman.noise_model import Noise
from identification.kalman.record import Record
from identification.logs.log import Log
from tests.factories import TORQUE_NOISE, closed_loop

TILT = {"αx": 0.03, "αy": 0.02}
"""The direction in which the pendulum's row is tilted [rad]."""


def moment(*effects: Effect) -> tuple[float, float]:
    """G1 [V] that a fit of a tilted base finds on a rig with some effects, and its standard deviation."""
    rig = TABLE_3.with_effects(*effects)
    run = closed_loop(rig, 0.004, 8.0, seed=1, torque_noise=TORQUE_NOISE, longest_step=5e-4)
    estimate = identify(Log.from_run(run, rig.unit, 4096), effects=["base_tilt"])
    return estimate.value("base_tilt.G1"), float(estimate.std[estimate.names.index("base_tilt.G1")])


def test_the_moment_of_a_tilted_base_is_found() -> None:
    """To what its error bar says, a twentieth: a wrong zero of the pendulum is a tilt until the arm turns."""
    found, std = moment(Effect("base_tilt", {**TILT, "G1": 2.0}))
    assert std < 0.12
    assert abs(found - 2.0) < 3.0 * std


def test_a_torque_that_no_gravity_gives_is_not_taken_for_a_tilt() -> None:
    """An arm that is drawn uphill: a ripple of one period a turn against the tilt that the pendulum shows."""
    size, angle = math.hypot(*TILT.values()), math.atan2(TILT["αy"], TILT["αx"])
    uphill = Effect("arm_ripple", {"A": 2.0 * size, "n": 1.0, "φ": math.pi - angle})
    found, _ = moment(Effect("base_tilt", {**TILT, "G1": 0.0}), uphill)
    assert 0.0 <= found < 0.1


def test_the_prior_of_the_moment_moves_with_the_pendulum_s() -> None:
    """Mechanics limit G1/θ5, whatever θ5 a fit starts from. The slopes are those of the cost."""
    run = closed_loop(TABLE_3, 0.004, 2.0, seed=1, torque_noise=TORQUE_NOISE, longest_step=5e-4)
    plant = TABLE_3.with_effects(Effect("base_tilt", {**TILT, "G1": 1.0}))
    records = [Record.from_log(Log.from_run(run, TABLE_3.unit, 4096))]
    problem = PredictionError(plant, records, plant_coordinates(plant), Noise(quietest(plant, records)))
    names = [c.name for c in problem.coordinates]
    z = problem.start()
    both = z.copy()
    for name in ("theta5", "base_tilt.G1"):
        both[names.index(name)] += 1.3
    assert problem.prior_cost(both) == pytest.approx(problem.prior_cost(z))
    assert problem.prior_cost(z) == pytest.approx(0.5 * (math.log(1.0 / (1.5 * TABLE_3.theta[4])) / 0.8) ** 2)
    value, gradient, _ = problem.priors.at(z)
    for i in range(len(z)):
        moved = z.copy()
        moved[i] += 1e-6
        assert (problem.prior_cost(moved) - value) / 1e-6 == pytest.approx(gradient[i], abs=1e-4)
