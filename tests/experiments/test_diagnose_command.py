"""What `furuta diagnose` writes and says where the logs show no plant."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from tests.commands import furuta, some_log


def test_without_a_plant_there_is_no_file_of_one_and_it_says_why(tmp_path: Path) -> None:
    """As docs/reference/diagnosis_file.md has it; the plant of an earlier run does not stay either."""
    log = some_log(tmp_path / "log.csv", q1=np.zeros(400))
    folder = tmp_path / "found"
    folder.mkdir()
    (folder / "plant.json").write_text("of an earlier run")
    result = furuta("diagnose", log, "-o", folder)
    assert result.exit_code == 0, result.output
    written = json.loads((folder / "diagnosis.json").read_text(encoding="utf-8"))
    assert written["verdict"] == "insufficient_excitation"
    assert written["where"] is None
    assert written["gap"] is None
    assert written["effects"] == written["ranking"] == []
    assert written["next_experiment"]
    assert not (folder / "plant.json").exists()
    for part in ("where", "gap"):
        assert "too little to fit a plant" in written["remarks"][part]
    assert "there is no plant.json: these logs move the rig too little" in result.stdout
    assert "not known" in result.stdout
