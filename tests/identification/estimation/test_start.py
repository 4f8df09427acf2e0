"""Start values from the logs alone."""

from __future__ import annotations

import math

import numpy as np
import pytest

from identification.estimation.start import candidates, reduced
from identification.kalman.record import Record
from tests.factories import TABLE_3, hanging_log, open_loop_log, paper_log


@pytest.mark.parametrize("moved", [(2 * math.pi, 0.0), (-600.0, 2 * math.pi), (0.0, 200 * math.pi)])
def test_starts_do_not_depend_on_where_the_angles_count_from(moved: tuple[float, float]) -> None:
    log = hanging_log()
    plain = candidates([log], TABLE_3)
    elsewhere = candidates([log.moved(*moved)], TABLE_3)
    for one, other in zip(plain, elsewhere, strict=True):
        np.testing.assert_allclose(other.plant.theta, one.plant.theta, rtol=1e-4)
        np.testing.assert_allclose(other.noise.torque, one.noise.torque, rtol=1e-4)


@pytest.mark.parametrize("zero", [0.0, -150.0])
def test_the_first_start_is_near_the_truth_of_a_fine_log(zero: float) -> None:
    """Ratios and the arm's inertia within a tenth, the scale within a half."""
    log, _ = paper_log()
    found = candidates([log.moved(zero, 0.0)], TABLE_3)[0].plant.theta
    true = TABLE_3.theta
    assert found[[2, 4]] / found[3] == pytest.approx(true[[2, 4]] / true[3], rel=0.1)
    assert found[0] == pytest.approx(true[0], rel=0.1)
    assert found[3] == pytest.approx(true[3], rel=0.5)


def test_no_sign_is_blamed_where_there_is_no_command() -> None:
    decay = open_loop_log(np.zeros(1000), q2=2.5)
    with pytest.raises(ValueError, match=r"the command does not change.*add a driven log") as raised:
        candidates([decay, decay], TABLE_3)
    assert "sign" not in str(raised.value)


def test_no_sign_is_blamed_where_the_motion_is_too_short_to_be_smoothed() -> None:
    log = paper_log(T=0.002, duration=8.0)[0]
    with pytest.raises(ValueError, match=r"at least 0\.5 s and 40 samples without a gap") as raised:
        candidates([log.slice(stop=0.45), log.slice(1.0, 1.45)], TABLE_3)
    assert "sign" not in str(raised.value)
    for T in (0.002, 0.02):  # what is asked for is enough
        fine = paper_log(T=T, duration=8.0)[0]
        assert candidates([fine.taken(slice(0, max(40, math.ceil(0.5 / T)) + 1))], TABLE_3)


def test_a_short_stretch_of_a_fast_clock_keeps_some_samples() -> None:
    """Thinned to 8 ms, two milliseconds at 10 kHz were one sample, and no such log could be fitted."""
    t = 1e-4 * np.arange(20)
    short = Record.from_arrays(t, np.column_stack([np.sin(30.0 * t)] * 2), np.cos(t), np.full(2, 1e-8), np.zeros(2))
    thin = reduced(short, math.inf, 8e-3)
    assert 5 <= len(thin.t) <= 20
    assert np.isfinite(thin.variance).all()
