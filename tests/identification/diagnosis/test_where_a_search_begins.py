"""The plant that a search begins with, and that its prior is around."""

from __future__ import annotations

import numpy as np
import pytest

from experiments.bench import HiddenEffect, Rig
from furuta_gym.plant import Plant
from identification import identify
from identification.diagnosis.held_out import HeldOut
from identification.diagnosis.naming.fits import Fit, FitRequest
from identification.diagnosis.searched import _adrift, searched
from identification.logs.log import Log
from tests.factories import bench_log, loop_log
from tests.identification.diagnosis.fits import POLICY


class Begun(Exception):
    """A search that was stopped at its first fit."""


def anchor_of(log: Log) -> Plant:
    """The plant that the search of a log begins with."""

    def first(request: FitRequest) -> Fit:
        raise Begun(request.anchor)

    with pytest.raises(Begun) as begun:
        searched(HeldOut((log,), (), POLICY), None, 1, ["input_delay"], lambda _: None, first)
    return begun.value.args[0]


def scale(plant: Plant) -> float:
    """θ3²/(θ1 θ4), which no effect changes and which is below one on every rig."""
    return float(plant.theta[2] ** 2 / (plant.theta[0] * plant.theta[3]))


def test_it_is_the_logs_own_scale_where_model_5_has_lost_it() -> None:
    """A late command hides how the pendulum pulls on the arm: model (5) is likeliest without a pendulum at all."""
    rig = Rig("servo", [HiddenEffect("input_delay", strength=3.0)], individual=11, scatter=0.08)
    log = bench_log(rig, "paper", 1, 10.0)
    before = identify(log)
    assert _adrift(before)
    after = identify(log, effects=["input_delay"])
    assert not _adrift(after)
    assert scale(before.plant) < 0.05 * scale(after.plant)
    off = np.log(anchor_of(log).theta[:5] / after.plant.theta[:5])[[0, 2, 3, 4]]
    assert np.abs(off).max() < 2.0  # a prior of 0.5 around it costs some nats; around model (5), many hundreds


def test_it_is_model_5_where_that_shows_its_scale() -> None:
    log, truth = loop_log(duration=8.0)
    before = identify(log)
    assert not _adrift(before)
    np.testing.assert_allclose(anchor_of(log).theta[[0, 2, 3, 4]], before.plant.theta[[0, 2, 3, 4]])
    assert scale(before.plant) == pytest.approx(scale(truth), rel=0.3)
