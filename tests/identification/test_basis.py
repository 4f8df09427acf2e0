"""Families of torques along logs of different clocks."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from furuta_gym.plant import TABLE_3
from identification.discrepancy.basis import Knots, Peaks, Signals, families

LAGS = (0, 1, 2, 3, 4, 5, 6, 8, 10, 13, 17)
LONGEST = LAGS[-1]  # samples of the fastest clock


def stepped(T: float) -> Signals:
    """A step of the command after a second, two seconds long, while nothing much moves."""
    t = np.arange(0, 2, T)
    q = np.column_stack([0.01 * np.sin(t), 0.01 * np.sin(3 * t)])
    return Signals(t, q, np.gradient(q, T, axis=0), np.zeros_like(q), (t >= 1.0).astype(float), q)


def changes(signals: Signals, knots: Knots) -> NDArray[np.float64]:
    """The columns of the command's changes (N, 11) by their lag."""
    (family,) = (f for f in families(signals, TABLE_3, knots, Peaks()) if f.variable == "change of the command")
    assert family.torque is not None
    return family.torque[:, 0, -len(LAGS) :]


def test_of_one_clock_they_are_the_changes_so_many_samples_before() -> None:
    one = stepped(0.001)
    step = np.diff(one.u, prepend=one.u[0])
    for column, lag in zip(changes(one, Knots.of([one])).T, LAGS, strict=True):
        assert np.array_equal(column[lag:], step[: len(step) - lag])
        assert not column[:lag].any()


@pytest.mark.parametrize("T", [0.001, 0.002, 0.003, 0.005])
def test_the_same_delay_is_the_same_column_whatever_the_clock(T: float) -> None:
    """Each log has its own clock, and one coefficient of each column is shared by all."""
    other = stepped(T)
    step = other.t[other.u > 0][0]
    for column, lag in zip(changes(other, Knots.of([stepped(0.001), other])).T, LAGS, strict=True):
        late = (other.t - step + 0.5 * T) @ column / column.sum()  # from the middle of each sample
        assert late == pytest.approx(0.001 * (lag + 0.5), abs=0.5 * T + 1e-9)
        assert column.sum() * T == pytest.approx(0.001)  # as much torque for as long
