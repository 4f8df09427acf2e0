"""`furuta validate` on a plant that was moved by hand says that the fit was before, on the terminal and the page."""

from __future__ import annotations

from pathlib import Path

import pytest

from furuta_gym.plant import TABLE_3
from identification.logs.log import write_log
from identification.logs.reading import read_log
from tests.commands import furuta
from tests.factories import loop_log

pytest.importorskip("plotly", reason="the page needs the extra 'report'")


def test_a_plant_that_was_moved_is_not_called_fitted(tmp_path: Path) -> None:
    path, page = tmp_path / "log.csv", tmp_path / "page.html"
    write_log(path, loop_log(T=0.004, duration=5.0)[0])
    provenance = {"logs": [{"source": "log.csv", "sha256": read_log(path).sha256}]}
    TABLE_3.replace(provenance=provenance).save(tmp_path / "fit.json")
    TABLE_3.replace(provenance=provenance | {"moved": {"theta6": 0.01, "arm_spring.k": None}}).save(
        tmp_path / "moved.json"
    )
    fit = furuta("validate", tmp_path / "fit.json", path)
    assert fit.exit_code == 0, fit.output
    assert "log.csv was fitted by this plant" in fit.stderr
    assert "by hand" not in fit.output
    moved = furuta("validate", tmp_path / "moved.json", path, "--report", page)
    assert moved.exit_code == 0, moved.output
    assert "log.csv was fitted before this plant was moved by hand (θ6, arm_spring.k)" in moved.stderr
    assert "were fitted before this plant was moved by hand" in moved.stdout
    assert "fitted by this plant" not in moved.output
    assert "the plant was fitted to it, then moved by hand (θ6, arm_spring.k)" in page.read_text(encoding="utf-8")
