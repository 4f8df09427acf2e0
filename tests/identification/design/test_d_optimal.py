"""Designed experiments: limits kept in other noise, better than the paper's d(t), and as precise as promised."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from controllers import make_controller
from furuta_gym.plant import QUBE, TABLE_3
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import simulate
from identification.design.d_optimal import Design, Precision, design, free_coordinates, predicted
from identification.design.setup import Limits, Setup, assumed_torque_noise, within_limits
from identification.design.signals import Sines, paper_signal
from identification.estimation.identify import identify
from identification.logs.log import Log
from tests.factories import PaperPolicy

LIMITS = Limits(q1=0.8, q2=0.2, u=8.0)
T = 0.004


def setup(duration: float = 6.0) -> Setup:
    return Setup.of(TABLE_3, PaperPolicy(T), duration, T)


@pytest.fixture(scope="module")
def found() -> Design:
    return design(setup(), LIMITS, evaluations=36)


def test_a_design_is_at_least_as_informative_as_the_papers_signal(found: Design) -> None:
    paper = within_limits(setup(), paper_signal(), LIMITS)
    assert found.paper.log_volume == predicted(setup(), setup().run(paper)).log_volume
    # the paper's own signal is tried first, so only a gain says that the search searches
    assert found.family != "the paper's d(t)"
    assert found.gain > 1.1


def test_a_gain_is_that_of_one_axis_in_the_geometric_mean(found: Design) -> None:
    wide = Precision(found.paper.std, found.precision.log_volume + 9 * math.log(4.0))  # nine axes twice as long
    assert replace(found, paper=wide).gain == pytest.approx(2.0)


def test_limits_hold_in_runs_with_other_noise(found: Design) -> None:
    """By `simulate` itself, with the command file's samples, not by the design's own bookkeeping."""
    _, d = found.samples()
    start = (0.0, setup().offset, 0.0, 0.0)
    for seed in (11, 12):
        run = simulate(TABLE_3, PaperPolicy(T), 6.0, T, Sensors(4096), d, start, assumed_torque_noise(TABLE_3), seed)
        assert np.abs(run.state[:, 0]).max() <= LIMITS.q1
        assert np.abs(run.state[:, 1]).max() <= LIMITS.q2
        assert np.abs(run.command).max() <= LIMITS.u
    # and one of them is used, or the experiment would be smaller than need be
    assert found.run.excess(LIMITS) > 0.8


def test_a_rate_limit_is_kept() -> None:
    slow = within_limits(setup(), Sines((1.0,), (0.5,), (0.0,)), Limits(u_rate=1500.0))
    u = setup().run(slow).command
    assert np.abs(np.diff(u)).max() / T <= 1500.0


@pytest.mark.parametrize("factor", [1 / 200, 12 / 255, 40.0])
def test_the_unit_of_the_command_changes_no_motion(factor: float) -> None:
    """N·m of a small motor, or counts of a duty: the same rig is excited as far as in volts, upright and hanging."""
    other = QUBE.replace(theta=QUBE.theta * factor, u_max=QUBE.u_max * factor, covariance=None)
    for policy in ("lqr", None):
        largest = []
        for plant in (QUBE, other):
            here = Setup.of(plant, make_controller(policy, plant, T) if policy else None, 6.0, T)
            limits = Limits(q1=1.0, q2=0.3 if policy else 1.5)
            largest.append(here.run(within_limits(here, paper_signal(), limits)).largest[:2])
        assert largest[1] == pytest.approx(largest[0], rel=0.02)


def test_a_motion_that_friction_holds_up_to_a_threshold_comes_near_its_limits() -> None:
    """A hanging pendulum under the paper's d(t), whose arm hardly moves below its friction."""
    hanging = Setup.of(QUBE, None, 20.0, T)
    limits = hanging.usual_limits
    assert hanging.run(within_limits(hanging, paper_signal(), limits)).excess(limits) > 0.85


def test_predicted_deviations_are_those_of_repeated_fits() -> None:
    """Monte Carlo over ten logs: root mean square over θ of actual over predicted deviation within a factor 1.5."""
    rig = setup(6.0)
    promised = predicted(rig, rig.run(paper_signal()))
    fits = []
    for seed in range(10):
        run = rig.run(paper_signal(), seed=100 + seed)
        log = Log.from_run(run, counts=4096)
        fits.append(identify(log, TABLE_3).values[:9])
    ratio = np.sqrt(np.mean((np.array(fits) - TABLE_3.theta) ** 2, axis=0)) / promised.std
    assert 1 / 1.5 < np.sqrt(np.mean(ratio**2)) < 1.5, ratio


def test_more_excitation_promises_more() -> None:
    weak, strong = (predicted(setup(), setup().run(paper_signal(scale=s))) for s in (0.5, 1.0))
    assert strong.log_volume < weak.log_volume
    assert np.all(strong.std[:5] < weak.std[:5])


def test_a_fall_promises_nothing() -> None:
    run = setup().run(paper_signal(scale=20.0))
    assert run.fell is not None
    assert predicted(setup(), run).log_volume == np.inf


def test_theta_comes_first_among_the_coordinates() -> None:
    records = [setup().record(setup().run(paper_signal()))]
    names = [c.name for c in free_coordinates(TABLE_3, records)]
    assert names[:9] == [f"theta{i}" for i in range(1, 10)]
    assert "log1.zero2" in names, "as identify frees it"


@pytest.mark.parametrize(
    ("limits", "word"),
    [({"q1": 0.01}, "without any excitation.*q1"), ({"q2": -1.0}, "positive"), ({"u_rate": 1.0}, "u̇")],
)
def test_limits_that_cannot_be_kept_are_explained(limits: dict[str, float], word: str) -> None:
    with pytest.raises(ValueError, match=word):
        within_limits(setup(), paper_signal(), Limits(**limits))


def test_a_loop_that_falls_by_itself_is_named() -> None:
    rig = Setup.of(TABLE_3, lambda y: 0.0, 4.0, T)
    with pytest.raises(ValueError, match="does not hold this plant up"):
        within_limits(rig, paper_signal(), LIMITS)


def test_a_search_needs_some_evaluations() -> None:
    with pytest.raises(ValueError, match="at least 36"):
        design(setup(), LIMITS, evaluations=5)
