"""What the tests of the command line share."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.commands import furuta


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
