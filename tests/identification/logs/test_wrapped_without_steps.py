"""Angles in rad that wrap often, of a sensor without steps: a jump of a turn is no speed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from furuta_gym.plant import QUBE
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import open_loop, simulate
from identification.design.signals import Chirp
from identification.logs.checks import LogWarning
from identification.logs.log import Log
from identification.logs.proposal import propose
from identification.logs.reading import read_log
from identification.logs.rig_mapping import RigMapping

from .test_proposal import table


@pytest.fixture(scope="module")
def hanging() -> Log:
    """A pendulum that hangs and swings, q2 = 0 upright: hanging is where an angle within ±π jumps."""
    T = 0.005
    run = simulate(QUBE, open_loop(), 10.0, T, Sensors(0), excitation=Chirp(2.0, 1.0, 2.5, 10.0), x0=(0, np.pi, 0, 0))
    log = Log.from_run(run, QUBE.unit, None)
    noise = 1e-3 * np.random.default_rng(0).normal(size=(2, len(log)))
    return replace(log, q1=log.q1 + noise[0], q2=log.q2 + noise[1])


def test_wrapped_radians_are_radians_and_are_unwrapped(hanging: Log, tmp_path) -> None:
    wrapped = np.angle(np.exp(1j * hanging.q2))
    assert (np.abs(np.diff(wrapped)) > np.pi).mean() > 0.01
    source = table(replace(hanging, q2=wrapped))
    said = {item.name: item.value for item in propose([source], RigMapping()).items}
    assert said["unit_q2"] == "rad"
    file = tmp_path / "log.csv"
    np.savetxt(
        file,
        np.c_[hanging.t, hanging.q1, wrapped, hanging.u],
        delimiter=",",
        header="t,q1,q2,u",
        comments="",
        fmt="%.4f",
    )
    with pytest.warns(LogWarning, match="Taken as a wrapped encoder and unwrapped"):
        found = read_log(file)
    assert np.abs(np.diff(found.q2)).max() < 1.0
    assert np.allclose(found.q2 - found.q2[0], hanging.q2 - hanging.q2[0], atol=1e-3)
