"""The study of rigs that change between two logs."""

from __future__ import annotations

from experiments.studies.changed_rigs import Case, asked, table

SAME = Case("servo", "", changed=False, held_out=False, seed=1)
OTHER = Case("servo", "", changed=True, held_out=False, seed=1)


def test_two_rigs_of_a_kind_are_told_from_one():
    rows = [asked(case, duration=4.0, only=["arm_spring"]) for case in (SAME, OTHER)]
    assert [row["said_to_differ"] for row in rows] == [False, True]
    assert [row["named"] for row in rows] == ["", ""]
    told = table(rows)
    assert "| of the same rig | searched | 0 of 1" in told
    assert "| of another rig | searched | 1 of 1" in told


def test_only_the_second_log_is_of_another_rig():
    (first, second), (same, other) = SAME.logs(1.0), OTHER.logs(1.0)
    assert (first.source, second.source) == ("paper.csv", "wide.csv")
    assert (same.q2 != other.q2).any()
