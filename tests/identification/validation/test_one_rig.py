"""Logs of two rigs, and of one."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from experiments.cli import app
from furuta_gym.plant import TABLE_3
from identification.estimation.identify import identify
from identification.logs.log import Log, write_log
from identification.validation.gap import validate
from identification.validation.one_rig import OneByOne, one_by_one
from tests.factories import loop_log, noisy_log


def asked(*logs: Log) -> OneByOne | None:
    estimate = identify(logs)
    return one_by_one(estimate, validate(estimate.plant, logs), logs)


def test_a_command_of_another_scale_in_one_log_is_one_factor_of_all_parameters() -> None:
    first, second = (loop_log(duration=5.0, T=0.004, seed=seed)[0] for seed in (0, 1))
    found = asked(first, Log(second.t, second.q1, second.q2, 0.8 * second.u, input_unit=second.input_unit))
    assert found is not None
    assert max(found.ratios) < 1.3
    assert len(found.factors) > 4
    assert list(found.factors.values()) == pytest.approx([0.8] * len(found.factors), rel=0.05)
    assert found.one_factor == pytest.approx(0.8, rel=0.02)
    assert "by one factor, 0." in str(found)
    assert "the command's unit or scale" in str(found)
    assert "different rigs, or the rig changed between them" in str(found)


def test_a_heavier_pendulum_is_told_by_its_parameters() -> None:
    heavier = TABLE_3.replace(theta=TABLE_3.theta * [1.05, 1.2, 1.2, 1.2, 1.2, 1, 1, 1, 1])
    found = asked(noisy_log(0, T=0.004, duration=5.0), noisy_log(1, heavier, T=0.004, duration=5.0))
    assert found is not None
    assert found.factors["theta5"] == pytest.approx(1.2, rel=0.05)
    assert found.one_factor is None
    assert "theta6" not in found.factors
    assert "theta5 by a factor of 1.2" in str(found)


def test_an_effect_that_differs_is_told_beside_a_common_factor() -> None:
    factors = {"theta1": 1.25, "theta4": 1.25, "arm_spring.k": 2.6}
    found = OneByOne(("a.csv", "b.csv"), (1.0, 1.0), factors, one_factor=1.25)
    assert "one factor, 1.25" in found.what_differs
    assert "What else differs from a.csv: arm_spring.k by a factor of 2.6" in found.what_differs
    assert found.to_dict()["one_factor"] == 1.25


def test_logs_of_one_rig_are_not_fitted_again() -> None:
    assert asked(*(loop_log(duration=4.0, T=0.004, seed=seed)[0] for seed in (0, 1))) is None
    late = [loop_log("input_delay", T=0.004, duration=4.0, seed=seed)[0] for seed in (0, 1)]
    assert asked(*late) is None  # alone they are not explained either


def test_logs_of_two_rigs_are_seen_with_a_value_kept_at_the_starts(tmp_path: Path) -> None:
    """The fits of single logs need the start, too; without it they failed, and nothing was said."""
    heavier = TABLE_3.replace(theta=TABLE_3.theta * [1.05, 1.2, 1.2, 1.2, 1.2, 1, 1, 1, 1])
    TABLE_3.save(tmp_path / "start.json")
    for i, plant in enumerate((TABLE_3, heavier)):
        write_log(tmp_path / f"log{i}.csv", noisy_log(i, plant, T=0.004, duration=5.0))
    logs = [str(tmp_path / f"log{i}.csv") for i in range(2)]
    given = ["--start", str(tmp_path / "start.json"), "--fix", "theta8", "-o", str(tmp_path / "rig.json")]
    result = CliRunner().invoke(app, ["identify", *logs, *given])
    assert result.exit_code == 0, result.output
    assert "different rigs, or the rig changed between them" in re.sub(r"\s+", " ", result.output)
