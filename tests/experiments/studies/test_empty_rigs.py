"""Empty rigs of two simulators: rounding is no structure that matters."""

from __future__ import annotations

from dataclasses import replace

import pytest

from experiments.bench import plain_lab
from experiments.studies import empty_rigs
from identification.diagnosis.locate.locate import locate
from identification.estimation.identify import identify
from identification.logs.log import Log


@pytest.mark.timeout(600)
def test_rounding_leaves_nothing_that_matters():
    """Development rigs of both simulators; `python -m experiments.studies.empty_rigs` has the rate on many."""
    rows = [empty_rigs.examined(trial) for trial in empty_rigs.plan(1, seed=1, split="dev")]
    assert {row["simulator"] for row in rows} == set(empty_rigs.SIMULATORS.values())
    assert all(row["problem"] == "" for row in rows), rows
    assert not any(row["matters"] for row in rows), rows
    assert empty_rigs.table(rows).count("0 of 1 = 0 %") >= 2


@pytest.mark.parametrize("seed", [3, 9, 12])
def test_rounding_leaves_nothing_beside_a_right_name(seed):
    rig = plain_lab.a_rig(seed)
    k = 0.3 * rig.theta[4]
    columns = plain_lab.a_log(replace(rig, cable=(k, -0.2)), "hanging", seed, duration=12.0)
    log = Log(**columns, encoder_counts=(rig.counts, rig.counts))
    estimate = identify(log, effects=["arm_spring"])
    assert estimate.value("arm_spring.k") == pytest.approx(k, rel=0.01)
    rest = locate(estimate.plant, log)
    assert not rest.structured, str(rest)


def test_what_is_said_to_be_left_is_counted():
    row = {"simulator": "the bench", "found": True, "matters": True, "counts": 0.7, "changing": False, "problem": ""}
    fine = {**row, "found": True, "matters": False, "counts": 0.1}
    moving = {**fine, "found": False, "changing": True}
    text = empty_rigs.table([row, fine, moving, {"simulator": "the bench", "problem": "lost"}])
    assert "| the bench | 2 of 3 = 67 %" in text
    assert "| 2 of 3 = 67 % (9 … 99 %) | 0.7 |" in text
