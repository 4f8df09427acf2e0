"""What the tests of the command line share."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from tests.commands import furuta

DATA = Path(__file__).parent.parent / "data"


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The paper's experiment on Table 3, simulated by the command: 20 s at 2 ms."""
    path = tmp_path_factory.mktemp("cli") / "log.csv"
    result = furuta(
        *("simulate", "--plant", "table3", "--controller", "paper-lqr", "--excitation", "paper", "-o", path, "--json")
    )
    assert result.exit_code == 0, result.output
    figures = json.loads(result.stdout)
    path.with_suffix(".json").write_text(json.dumps(figures))
    return path


@pytest.fixture
def german(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with both German logs, in which the commands are given."""
    for name in ("versuch1.csv", "versuch2.csv"):
        shutil.copy(DATA / name, tmp_path / name)
    monkeypatch.chdir(tmp_path)
    return tmp_path
