"""Verdicts that need no fit: of a motion, and of error bars that are given."""

from __future__ import annotations

import numpy as np
import pytest

from furuta_gym.plant import TABLE_3, THETA_NAMES
from furuta_gym.plant.covariance import NORMAL_95
from identification.estimation.estimate import Estimate
from identification.estimation.identifiability import Motion, gate, judge
from identification.logs.log import Log
from tests.factories import made_log, paper_log

ROW = ("theta3", "theta4", "theta5", "theta7", "theta9")
"""What shares the scale of the pendulum's row."""


@pytest.fixture(scope="module")
def log() -> Log:
    return paper_log(T=0.005, duration=4.0)[0]


def _judged(log: Log, relative: dict[str, float], names: tuple[str, ...] = THETA_NAMES):
    values = np.array([TABLE_3.theta[THETA_NAMES.index(n)] for n in names])
    std = np.array([relative.get(n, 0.01) for n in names]) * np.abs(values)
    return judge(names, values, np.diag(std**-2.0), Motion.of([log]), std)


@pytest.mark.parametrize(
    ("share", "level"), [(0.29, "good"), (0.31, "weak"), (0.99, "weak"), (1.01, "not identifiable")]
)
def test_levels_begin_where_the_manual_says(log: Log, share: float, level: str) -> None:
    """docs/how-to/verdicts.md: weak from 30 %, not identified from 100 %."""
    found = _judged(log, {"theta1": share})
    assert found.level == level
    assert found.weak == (("theta1",) if level == "weak" else ())
    assert found.unidentified == (("theta1",) if level == "not identifiable" else ())


def test_frictions_of_a_row_without_a_scale_are_not_identified(log: Log) -> None:
    """At its bound a friction has a tiny error bar, and it is as unknown as the scale that it shares."""
    found = _judged(log, dict.fromkeys(("theta3", "theta4", "theta5"), 5.0))
    assert found.unidentified == ROW
    assert not set(ROW) & set(found.weak)
    assert any("θ3, θ4, θ5, θ7, θ9 share a scale" in sentence for sentence in found.advice)


def test_a_scale_that_one_of_the_row_has_is_there_for_all(log: Log) -> None:
    assert _judged(log, dict.fromkeys(("theta3", "theta4"), 5.0)).unidentified == ("theta3", "theta4")
    fixed = tuple(n for n in THETA_NAMES if n != "theta5")
    assert _judged(log, dict.fromkeys(("theta3", "theta4"), 5.0), fixed).unidentified == ("theta3", "theta4")


def test_no_error_bar_is_printed_of_what_is_not_identified(log: Log) -> None:
    """Of a friction that only a bound is known of, the bound; of a scale that is lost, the value alone."""
    relative = dict.fromkeys(("theta3", "theta4", "theta5"), 5.0) | {"theta2": 20.0, "theta8": 3.0}
    std = np.array([relative.get(n, 0.01) for n in THETA_NAMES]) * TABLE_3.theta
    verdict = _judged(log, relative)
    estimate = Estimate(TABLE_3, "test", THETA_NAMES, TABLE_3.theta, np.diag(std**2), verdict)
    lines = {line.split()[0]: line for line in str(estimate).splitlines() if line.startswith("  theta")}
    for name, line in lines.items():
        assert ("±" in line) == (name in ("theta1", "theta6")), line
        assert ("NOT IDENTIFIED" in line) != ("±" in line), line
    most = TABLE_3.theta[7] * (1 + 3 * NORMAL_95)
    assert f"below {most:.2g} " in lines["theta8"]
    assert "%" not in lines["theta2"]
    assert "below" not in lines["theta7"], "the scale that it shares is lost"


@pytest.mark.parametrize(("known", "said"), [((), "have no scale"), (("theta4",), "a fit needs a command")])
def test_a_log_without_a_command_is_refused_for_the_reason_that_holds(known: tuple[str, ...], said: str) -> None:
    swing = np.linspace(0.0, 20.0, 2000)
    decay = made_log(n=2000, q1=0.2 * np.sin(swing), q2=np.pi + 0.5 * np.cos(swing), u=np.zeros(2000))
    found = gate([decay], known)
    assert found is not None
    assert said in found.summary
    assert ("no scale" in found.summary) == (not known)
