"""A short log of a rig with a spring that model (5) lacks, what fits make of it, and a browser that looks at them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from furuta_gym.plant import TABLE_3, Effect, Plant
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


@pytest.fixture(scope="session")
def with_spring(spring_log: Path, fitted: Any) -> Plant:
    """The plant with the spring, all fitted together."""
    start = fitted[0].plant.replace(covariance=None, checks={})
    return identify(read_log(spring_log), start, effects=[fitted[0].plant.default_effect("arm_spring")]).plant


@pytest.fixture(scope="session")
def session_file(spring_log: Path, fitted: Any, with_spring: Plant, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A saved session in which the log was fitted and the plant with the spring was kept."""
    from experiments.studio.saved import save_session
    from experiments.studio.session import Session

    session = Session(tmp_path_factory.mktemp("session"))
    session.add(spring_log)
    session.accept()
    session.estimate, session.gap = fitted
    session.kept = with_spring
    return save_session(session, session.target("spring.furuta"))


@pytest.fixture(scope="module")
def window() -> Iterator[Any]:
    """Chromium; skips, with the reason, where there is none."""
    from experiments.studio.drive import browser

    try:
        with browser() as found:
            yield found
    except ValueError as error:
        pytest.skip(str(error))
