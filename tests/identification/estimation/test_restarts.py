"""Fits that stalled in the valley of the pendulum's scale, and the restarts that bring them out."""

from __future__ import annotations

import numpy as np
import pytest

from experiments.bench import HiddenEffect, Rig
from identification.estimation.identify import identify
from identification.estimation.long_logs import glimpse_of
from identification.estimation.optimise import TOLERANCE, minimise
from identification.estimation.restarts import restarted
from tests.factories import bench_log, loop_log

STRONG = {
    "servo": Rig("servo", [HiddenEffect("arm_spring", 2.0)], individual=3, scatter=0.08, sample_time=4e-3),
    "table3": Rig("table3", [HiddenEffect("arm_spring", 3.0)], individual=3, scatter=0.08, sample_time=4e-3),
}
"""Rigs of the bench, which shares no code with the plant, with a cable that is stronger than anything else."""


@pytest.mark.parametrize("name", STRONG)
def test_a_strong_cable_is_sized_to_a_hundredth(name: str) -> None:
    rig = STRONG[name]
    log = bench_log(rig, "wide", seed=1, duration=12.0)
    (hidden,) = rig.truth()["effects"]
    k = hidden["parameters"]["k"]["value"]
    estimate = identify(log, effects=["arm_spring"])
    assert estimate.converged
    assert estimate.value("arm_spring.k") == pytest.approx(k, rel=0.01)
    for theta, true in list(rig.truth()["theta"].items())[2:5]:
        assert estimate.value(theta) == pytest.approx(true, rel=0.05)


def test_a_glimpse_has_its_minimum_near_that_of_all_samples():
    """Within the errors of both: θ of a fit of the glimpse, and of all."""
    log, plant = loop_log(duration=12.0)
    estimate = identify(log, plant)
    problem, optimum = estimate.problem, estimate.optimum
    assert problem is not None
    assert optimum is not None
    glimpse = glimpse_of(problem)
    assert glimpse is not None
    assert len(glimpse.records[0].t) * 8e-3 == pytest.approx(12.0, rel=0.01)
    there = minimise(glimpse, optimum.z, 20)
    spread = np.sqrt(np.diag(np.linalg.inv(there.expansion.information)))
    assert np.all(np.abs(there.z - optimum.z) < 4.0 * spread)
    assert np.any(there.z != optimum.z)
    assert glimpse_of(problem.on(glimpse.records)) is None, "nothing is saved there"


def test_a_restart_leaves_a_good_fit_alone_and_mends_a_stalled_one() -> None:
    """The stalled one: the scale of the pendulum's row at an eighth, and so much noise that nothing pulls it back."""
    rig = STRONG["table3"]
    estimate = identify(bench_log(rig, "wide", seed=1, duration=12.0), effects=["arm_spring"])
    problem, optimum = estimate.problem, estimate.optimum
    assert problem is not None
    assert optimum is not None
    assert restarted(problem, optimum, 20, TOLERANCE, exact=False) is optimum
    z = optimum.z.copy()
    for i, c in enumerate(problem.coordinates):
        if c.name in ("theta2", "theta3", "theta4", "theta5"):
            z[i] -= 2.0
        if c.noise and c.row < 2:
            z[i] += 12.0
    stalled = minimise(problem, z, 4, TOLERANCE, exact=False)
    assert stalled.value > optimum.value + 100.0
    assert restarted(problem, stalled, 40, TOLERANCE, exact=False).value < optimum.value + 1.0


def test_a_stop_that_never_slips_in_a_fit_gets_another_travel() -> None:
    """It is a spring, of which the readings tell no travel: no descent comes back from there."""
    effects = [HiddenEffect("arm_cable", 1.0), HiddenEffect("arm_hysteresis", 2.0)]
    rig = Rig("workshop", effects, individual=3)
    estimate = identify(bench_log(rig, "wide", seed=1, duration=8.0), effects=["arm_cable", "arm_hysteresis"])
    travel = rig.truth()["effects"][1]["parameters"]["d"]["value"]
    assert estimate.value("arm_hysteresis.d") == pytest.approx(travel, rel=0.05)
    problem, optimum = estimate.problem, estimate.optimum
    assert problem is not None
    assert optimum is not None
    z = optimum.z.copy()
    for i, c in enumerate(problem.coordinates):
        if c.name.startswith("arm_hysteresis"):
            z[i] = c.to_z({"d": 2.5, "κ": 0.03}[c.name[-1]])
        if c.noise and c.row < 2:
            z[i] += 5.0
    stuck = minimise(problem, z, 30, TOLERANCE, exact=False)
    assert stuck.value > optimum.value + 50.0
    assert restarted(problem, stuck, 40, TOLERANCE, exact=False).value < optimum.value + 1.0
