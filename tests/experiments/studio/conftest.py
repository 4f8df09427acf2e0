"""A short log of a rig with a spring that model (5) lacks, and what a fit makes of it."""

from __future__ import annotations

from pathlib import Path

import pytest

from furuta_gym.plant import TABLE_3, Effect
from identification import Log, identify, read_log, validate, write_log
from tests.factories import TORQUE_NOISE, closed_loop

pytest.importorskip("nicegui", reason="the studio needs NiceGUI (extra studio)")

SPRING = Effect("arm_spring", {"k": 0.12, "q1n": 0.3})


@pytest.fixture(scope="session")
def spring_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """8 s at 4 ms."""
    run = closed_loop(TABLE_3.with_effects(SPRING), 0.004, 8.0, torque_noise=TORQUE_NOISE)
    path = tmp_path_factory.mktemp("studio") / "spring.csv"
    write_log(path, Log.from_run(run, counts=4096))
    return path


@pytest.fixture(scope="session")
def fitted(spring_log: Path):
    """The estimate and the gap of model (5) on that log."""
    log = read_log(spring_log)
    estimate = identify(log)
    return estimate, validate(estimate.plant, log)
