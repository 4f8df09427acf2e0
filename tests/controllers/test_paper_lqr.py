"""The paper's experiment: with −K x the pendulum stands for 20 s under excitation, with the printed sign it falls."""

import numpy as np
import pytest

from controllers import DesignError, make_controller
from controllers.linear.paper_lqr import design_paper_lqr
from furuta_gym.plant import LARGE_RIG, PAPER_GAIN, QUBE, TABLE_3
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import simulate


def square(t, amplitude, period):
    """−amplitude in the first half of each period, +amplitude in the second."""
    return np.where(np.mod(t, period) <= period / 2, -amplitude, amplitude)


def paper_excitation(t):
    """d1 + d2 + d3 of Eq. (24)."""
    return square(t, 1.0, 2.0) + square(t, 0.5, 0.5) + square(t, 0.25, 0.3333)


@pytest.mark.parametrize("sample_time", [0.001, 0.002, 0.005])
def test_stands_under_the_papers_excitation(sample_time):
    controller = make_controller("paper-lqr", "table3", sample_time)
    run = simulate(TABLE_3, controller, 20.0, sample_time, Sensors(), excitation=paper_excitation)
    assert run.fell is None
    assert np.abs(run.state[:, 1]).max() < 0.2
    assert 0.05 < np.abs(run.state[:, 0]).max() < 1.0  # it is really excited


def test_falls_with_the_printed_sign():
    controller = design_paper_lqr(TABLE_3, 0.002, printed_sign=True)
    run = simulate(TABLE_3, controller, 20.0, 0.002, excitation=paper_excitation, q2_limit=1.0)
    assert run.fell is not None
    assert run.fell < 1.0


def test_poles_of_the_erratum():
    """Row 4: −K x has poles −4.42 ± 10.97i and −2.66 ± 1.84i, +K x one near +25.7 1/s."""
    from furuta_gym.plant.linearization import linearize

    linear = linearize(TABLE_3)
    K = PAPER_GAIN[[0, 2, 1, 3]][None]
    poles = np.sort_complex(np.linalg.eigvals(linear.A - linear.B @ K))
    assert poles == pytest.approx(np.array([-4.42 - 10.97j, -4.42 + 10.97j, -2.66 - 1.84j, -2.66 + 1.84j]), abs=0.01)
    assert np.linalg.eigvals(linear.A + linear.B @ K).real.max() == pytest.approx(25.7, abs=0.1)


@pytest.mark.parametrize("plant", [QUBE, LARGE_RIG])
def test_refuses_rigs_that_it_does_not_stabilize(plant):
    with pytest.raises(DesignError, match=r"Table 3.*Use lqr"):
        make_controller("paper-lqr", plant)
