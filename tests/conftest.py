"""What every test shares: deterministic hypothesis, and the measured logs when the machine has them."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

ROOT = Path(__file__).resolve().parent.parent

# Compilation happens inside the first example, so deadlines would measure the compiler.
settings.register_profile(
    "furuta", derandomize=True, deadline=None, database=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("furuta")


@pytest.fixture(scope="session")
def real_data() -> Path:
    """Folder of the measured logs (FURUTA_DATA, else ../shared/data beside the repository)."""
    named = os.environ.get("FURUTA_DATA")
    folder = Path(named) if named else ROOT.parent / "shared" / "data"
    if not any(folder.glob("*/*.csv")):
        pytest.skip(f"no measured logs in {folder}: set FURUTA_DATA to the folder that holds qube_darmstadt/")
    return folder
