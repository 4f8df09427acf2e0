"""Empty rigs of two simulators: rounding is no structure that matters."""

from __future__ import annotations

import pytest

from experiments.studies import empty_rigs


@pytest.mark.timeout(600)
def test_rounding_leaves_nothing_that_matters():
    """Development rigs of both simulators; `python -m experiments.studies.empty_rigs` has the rate on many."""
    rows = [empty_rigs.examined(trial) for trial in empty_rigs.plan(1, seed=1, split="dev")]
    assert {row["simulator"] for row in rows} == set(empty_rigs.SIMULATORS.values())
    assert all(row["problem"] == "" for row in rows), rows
    assert not any(row["matters"] for row in rows), rows
    assert empty_rigs.table(rows).count("0 of 1 = 0 %") >= 2


def test_what_is_said_to_be_left_is_counted():
    row = {"simulator": "the bench", "found": True, "matters": True, "counts": 0.7, "changing": False, "problem": ""}
    fine = {**row, "found": True, "matters": False, "counts": 0.1}
    moving = {**fine, "found": False, "changing": True}
    text = empty_rigs.table([row, fine, moving, {"simulator": "the bench", "problem": "lost"}])
    assert "| the bench | 2 of 3 = 67 %" in text
    assert "| 2 of 3 = 67 % (9 … 99 %) | 0.7 |" in text
