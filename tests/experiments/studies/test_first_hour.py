"""The walk of the first hour types what is said, and nothing else."""

from __future__ import annotations

from pathlib import Path

from experiments.studies.first_hour import Step, following, walk

DATA = Path(__file__).parents[2] / "data"


def said(text: str) -> Step:
    return Step("furuta x", 0, 1.0, 100, text)


def test_the_next_command_is_the_one_that_is_said() -> None:
    step = said("Written: rig.json\nNext: furuta validate rig.json LOG   (a log that was not fitted)\n")
    assert following(step, ["two.csv"]) == "furuta validate rig.json two.csv"
    assert following(said("nothing"), ["two.csv"]) is None
    held = said("Next: furuta diagnose one.csv --held-out LOG -o diagnosis   (LOG: not fitted)\n")
    assert (
        following(held, ["two.csv", "x y.csv"]) == "furuta diagnose one.csv --held-out two.csv 'x y.csv' -o diagnosis"
    )
    assert following(held, []) == "furuta diagnose one.csv -o diagnosis"
    assert step.reading == 30.0


def test_the_walk_begins_with_the_help_and_the_mapping(tmp_path: Path) -> None:
    steps = walk([DATA / "versuch1.csv", DATA / "versuch2.csv"], tmp_path, last="init")
    assert [step.command for step in steps] == ["furuta --help", "furuta init --help", "furuta init versuch1.csv"]
    assert not any(step.code for step in steps)
    assert following(steps[-1], ["versuch2.csv"]) == "furuta identify versuch1.csv -o rig.json"
    assert (tmp_path / "rig.toml").exists()
