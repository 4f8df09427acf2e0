"""The next command that `furuta validate` proposes is one that `furuta diagnose` takes."""

from __future__ import annotations

from pathlib import Path

import pytest

from furuta_gym.plant import TABLE_3
from identification.logs.log import write_log
from identification.logs.reading import read_log
from tests.commands import furuta
from tests.factories import loop_log

WRONG = TABLE_3.replace(theta=TABLE_3.theta * [1.0, 1.6, 1.6, 1.6, 1.6, 1.0, 1.0, 1.0, 1.0])


@pytest.fixture
def week(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A plant that misses much, fitted to old.csv, with old.csv and two new logs."""
    monkeypatch.chdir(tmp_path)
    for seed, name in enumerate(("old.csv", "new1.csv", "new2.csv")):
        write_log(tmp_path / name, loop_log(T=0.004, duration=5.0, seed=seed)[0])
    provenance = {"logs": [{"source": "old.csv", "sha256": read_log(tmp_path / "old.csv").sha256}]}
    WRONG.replace(provenance=provenance).save(tmp_path / "rig.json")
    return tmp_path


def proposed(*logs: str) -> str:
    result = furuta("validate", "rig.json", *logs)
    assert result.exit_code == 0, result.output
    return result.stdout[result.stdout.index("Next: ") :]


def test_the_fitted_log_is_searched_and_the_plants_are_compared_first(week: Path) -> None:
    said = proposed("new1.csv", "new2.csv")
    assert "furuta diagnose old.csv --held-out new1.csv new2.csv -o diagnosis" in said
    assert "furuta identify old.csv new1.csv new2.csv" in said


@pytest.mark.parametrize(
    ("logs", "command"),
    [
        (("old.csv", "new2.csv"), "furuta diagnose old.csv --held-out new2.csv -o diagnosis"),
        (("old.csv",), "furuta diagnose old.csv -o diagnosis"),
        (("new1.csv", "new2.csv"), "furuta diagnose new1.csv --held-out new2.csv -o diagnosis"),
    ],
)
def test_a_name_that_is_another_log_now_is_not_taken_for_the_fitted_one(
    week: Path, logs: tuple[str, ...], command: str
) -> None:
    (week / "old.csv").write_bytes((week / "new1.csv").read_bytes())
    assert command in proposed(*logs)
