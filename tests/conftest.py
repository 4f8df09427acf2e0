"""What every test shares: deterministic hypothesis, the mark of slow tests, and the measured logs where they are."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

ROOT = Path(__file__).resolve().parent.parent
SLOW = ROOT / "tests" / "slow.txt"

# Compilation happens inside the first example, so deadlines would measure the compiler.
settings.register_profile(
    "furuta", derandomize=True, deadline=None, database=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("furuta")


@pytest.hookimpl(tryfirst=True)  # before -m selects
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark what tests/slow.txt lists. Raises pytest.UsageError for an entry of a collected file that is no test."""
    lines = SLOW.read_text(encoding="utf-8").splitlines()
    listed = {line.strip() for line in lines if line.strip() and not line.startswith("#")}
    files, found = set(), set()
    for item in items:
        file, *names = item.nodeid.split("[")[0].split("::")
        files.add(file)
        levels = {"::".join([file, *names[:depth]]) for depth in range(len(names) + 1)}
        if entries := listed & levels:
            found |= entries
            item.add_marker(pytest.mark.slow)
    whole = not any("::" in argument for argument in config.args)
    if whole and (stale := sorted(entry for entry in listed - found if entry.split("::")[0] in files)):
        raise pytest.UsageError(f"tests/slow.txt lists what is no test: {', '.join(stale)}")


@pytest.fixture(scope="session")
def real_data() -> Path:
    """Folder of the measured logs (FURUTA_DATA, else ../shared/data beside the repository)."""
    named = os.environ.get("FURUTA_DATA")
    folder = Path(named) if named else ROOT.parent / "shared" / "data"
    if not any(folder.glob("*/*.csv")):
        pytest.skip(f"no measured logs in {folder}: set FURUTA_DATA to the folder that holds qube_darmstadt/")
    return folder
