"""The check of a plant by a limit of the rig's own: what it says, and the exit code of `furuta validate --limit`."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from furuta_gym.plant import TABLE_3
from identification import write_log
from identification.validation.gap import Gap
from identification.validation.limit import Answer, checked
from tests.commands import furuta, refused
from tests.factories import loop_log

PAGE = Path(__file__).resolve().parents[2] / "docs" / "how-to" / "lab_ci.md"
FLOOR = np.array([1e-3, 1e-3])
GOOD = Gap(
    horizon=0.3,
    rms=1.05 * FLOOR,
    floor=FLOOR,
    reading_floor=0.9 * FLOOR,
    fit_percent=np.array([90.0, 90.0]),
    whiteness=0.0,
    counts=np.zeros(2),
    repeats=False,
    curve=np.zeros((0, 5)),
    tests=(),
    errors=np.zeros((0, 2)),
    floors=np.zeros((0, 2)),
    reading_floors=np.zeros((0, 2)),
    times=np.zeros(0),
    log=np.zeros(0, int),
    surprise=np.zeros((0, 3)),
)
NOISY, STILL = {"reading_floor": np.array([0.1, 0.9]) * 1e-3}, {"resting": np.array([0.1, 0.95])}


@pytest.mark.parametrize(
    ("ratio", "changed", "fitted", "answer"),
    [
        (1.05, {}, [], Answer.HOLDS),
        (1.99, {}, [], Answer.HOLDS),
        (2.01, {}, [], Answer.FAILS),
        (2.5, NOISY, [], Answer.FAILS),
        (2.5, STILL, [], Answer.UNKNOWN),
        (8.5, STILL, [], Answer.FAILS),
        (0.5, {}, [], Answer.UNKNOWN),
        (1.05, NOISY, [], Answer.UNKNOWN),
        (1.05, {"differ": 4.0}, [], Answer.UNKNOWN),
        (1.05, {}, ["today1.csv"], Answer.UNKNOWN),
        (np.nan, {}, [], Answer.FAILS),
    ],
)
def test_what_is_answered(ratio: float, changed: dict[str, Any], fitted: list[str], answer: Answer) -> None:
    found = checked(replace(GOOD, rms=ratio * FLOOR, **changed), 2.0, fitted)
    assert found.answer is answer
    assert str(found).startswith(f"Check: {answer.value}. ")
    assert found.to_dict()["answer"] == answer.name.lower()


def test_the_page_names_every_exit_code() -> None:
    codes = re.findall(r"^\| (\d+) \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert {int(code) for code in codes} == {2, *(answer.exit_code for answer in Answer)}


def test_the_command_ends_with_the_answer(recorded: Path, tmp_path: Path) -> None:
    """With a limit only. What was asked for is written all the same."""
    log, _ = loop_log("arm_spring", 2.0, T=0.004, duration=6.0)
    write_log(tmp_path / "spring.csv", log)
    plant = TABLE_3.save(tmp_path / "rig.json")
    assert furuta("validate", plant, tmp_path / "spring.csv").exit_code == 0
    done = furuta("validate", plant, tmp_path / "spring.csv", "--limit", "2", "--json", tmp_path / "gap.json")
    assert done.exit_code == 10
    assert done.stdout.splitlines()[-1].startswith(
        "Check: the plant does not describe the rig in these logs. The error is"
    )
    found = json.loads((tmp_path / "gap.json").read_text())["check"]
    assert (found["answer"], found["limit"]) == ("fails", 2.0)
    for text in ("0.5", "nan", "inf"):
        refused(furuta("validate", plant, recorded, "--limit", text), "expected 1 or more")
