"""The script of the page on weekly checks: what it ends with."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

PAGE = Path(__file__).resolve().parents[2] / "docs" / "how-to" / "lab_ci.md"
GOOD = {
    "ratio_to_floor": 1.05,
    "resting_share_q1": 0.1,
    "resting_share_q2": None,
    "torque_noise_share_q1": 0.2,
    "torque_noise_share_q2": 0.0,
    "repeats_differ": None,
}


@pytest.mark.parametrize(
    ("changed", "fitted", "ends"),
    [
        ({}, [], 0),
        ({"ratio_to_floor": 2.5}, [], 10),
        ({"ratio_to_floor": 2.5, "torque_noise_share_q1": 0.99}, [], 10),
        ({"ratio_to_floor": 2.5, "resting_share_q2": 0.95}, [], 11),
        ({"ratio_to_floor": 8.5, "resting_share_q2": 0.95}, [], 10),
        ({"ratio_to_floor": 0.5}, [], 11),
        ({"torque_noise_share_q2": 0.99}, [], 11),
        ({"repeats_differ": 4.0}, [], 11),
        ({}, ["today1.csv"], 11),
    ],
)
def test_the_exit_code_says_what_was_found(
    changed: dict[str, Any], fitted: list[str], ends: int, tmp_path: Path
) -> None:
    (script,) = re.findall(r"python - << 'END'\n(.*?)\nEND\n", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    (tmp_path / "gap.json").write_text(json.dumps({"gap": GOOD | changed, "fitted_logs": fitted}))
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, check=False, timeout=60)
    assert done.returncode == ends
    assert f"| {ends} |" in PAGE.read_text(encoding="utf-8")


def test_what_it_reads_is_in_the_answer_of_validate(recorded: Path, tmp_path: Path) -> None:
    from furuta_gym.plant import TABLE_3
    from tests.commands import furuta

    plant = TABLE_3.save(tmp_path / "rig.json")
    done = furuta("validate", plant, recorded, "--json", tmp_path / "gap.json")
    assert done.exit_code == 0, done.output
    found = json.loads((tmp_path / "gap.json").read_text())
    assert found["fitted_logs"] == []
    assert set(GOOD) <= set(found["gap"])
