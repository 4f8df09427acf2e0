"""The count of intervals that hold the truth, on estimates made by hand and on a rig of the bench."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
import pytest

from experiments.studies.error_bars import compared, known, main, off, plan, table
from identification.estimation.estimate import Estimate
from identification.estimation.identifiability import Identifiability
from identification.estimation.identify import identify
from tests.factories import noisy_log


def test_a_logarithm_is_compared_as_one() -> None:
    assert off("theta4", 0.02, 0.01) == pytest.approx(0.02 * math.log(2.0))
    assert off("theta8", 0.02, 0.01) == pytest.approx(0.01)
    assert off("theta8", 0.0, 0.01) == pytest.approx(0.01)


def test_only_what_follows_the_librarys_law_is_known() -> None:
    own = {"name": "arm_spring", "form": "table", "parameters": {"k": {"value": 0.2}}}
    other = {"name": "input_delay", "form": "bench", "parameters": {"d": {"value": 0.01}}}
    truth = {"theta": {"theta1": 1.0}, "effects": [own, other]}
    assert known(truth) == {"theta1": 1.0, "arm_spring.k": 0.2}


@pytest.fixture(scope="module")
def estimate() -> Estimate:
    return identify(noisy_log(0))


def test_stated_intervals_and_those_of_a_right_model_are_counted_apart(estimate: Estimate) -> None:
    values = dict(zip(estimate.names, estimate.values.tolist(), strict=True))
    right = dict(zip(estimate.names, estimate.std_if_right.tolist(), strict=True))
    truth = {"theta6": values["theta6"] + 3.0 * right["theta6"], "theta8": values["theta8"], "theta99": 1.0}
    rows = {row["parameter"]: row for row in compared(estimate, truth)}
    assert set(rows) == {"theta6", "theta8"}
    assert rows["theta6"]["deviations_if_right"] == pytest.approx(3.0)
    assert not rows["theta6"]["inside_if_right"]
    assert rows["theta6"]["inside"] == (rows["theta6"]["widened"] > 3.0 / 1.96)
    assert rows["theta8"]["inside"]
    assert rows["theta8"]["inside_if_right"]


def test_what_is_not_identified_is_not_counted(estimate: Estimate) -> None:
    from dataclasses import replace

    lost = replace(estimate.identifiability, unidentified=("theta2",))
    assert isinstance(lost, Identifiability)
    names = {row["parameter"] for row in compared(replace(estimate, identifiability=lost), {"theta2": 1.0})}
    assert not names


def test_the_table_has_rates_of_each_model_and_leaves_problems_out() -> None:
    def row(model: str, parameter: str, inside: bool) -> dict:
        return {"id": "a", "model": model, "parameter": parameter, "problem": "", "widened": 2.0} | {
            "inside": inside,
            "inside_if_right": False,
        }

    rows = [row("missing", "theta1", True), row("missing", "theta2", False), row("right", "arm_spring.k", True)]
    told = table([*rows, {"id": "b", "problem": "the pendulum is lost"}])
    assert "| model (5), effects missing | θ | 1 | 1 of 2 = 50 %" in told
    assert "| the right model | of effects | 1 | 1 of 1 = 100 %" in told
    assert "another law" not in told


def test_a_plan_has_what_is_asked_for() -> None:
    kinds = [trial.kind for trial in plan(1, "dev", 3, 2, 1)]
    assert kinds == ["library"] * 3 + ["composite"] * 2 + ["none"]


def test_an_empty_rig_is_examined(tmp_path: Path) -> None:
    main(effects=0, composite=0, none=1, seed=1, split="dev", jobs=1, output=tmp_path)
    with open(tmp_path / "error_bars.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["model"] for row in rows} == {"right"}
    assert len(rows) == 9
    assert np.mean([row["inside"] == "True" for row in rows]) >= 8 / 9
