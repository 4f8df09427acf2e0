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


def _slow() -> list[str]:
    """Entries of tests/slow.txt, files or tests."""
    return [line for line in SLOW.read_text(encoding="utf-8").splitlines() if line and not line.startswith("#")]


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """The fast part does not import what is slow as a whole."""
    if config.option.markexpr == "not slow" and collection_path.suffix == ".py":
        return collection_path.relative_to(ROOT).as_posix() in _slow() or None
    return None


@pytest.hookimpl(tryfirst=True)  # before -m selects
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark what tests/slow.txt lists, in its order. Raises pytest.UsageError for an entry that is no test."""
    listed = _slow()
    files, found = set(), set()
    for item in items:
        file, *names = item.nodeid.split("[")[0].split("::")
        files.add(file)
        levels = {"::".join([file, *names[:depth]]) for depth in range(len(names) + 1)}
        if entries := levels.intersection(listed):
            found |= entries
            item.add_marker(pytest.mark.slow)
    rank = {file: i for i, file in enumerate(dict.fromkeys(entry.split("::")[0] for entry in listed))}
    items.sort(key=lambda item: rank.get(item.nodeid.split("::")[0], len(rank)))
    whole = not any("::" in argument for argument in config.args)
    if whole and (stale := [entry for entry in listed if entry not in found and entry.split("::")[0] in files]):
        raise pytest.UsageError(f"tests/slow.txt lists what is no test: {', '.join(stale)}")


@pytest.fixture(scope="session")
def real_data() -> Path:
    """Folder of the measured logs (FURUTA_DATA, else ../shared/data beside the repository)."""
    named = os.environ.get("FURUTA_DATA")
    folder = Path(named) if named else ROOT.parent / "shared" / "data"
    if not any(folder.glob("*/*.csv")):
        pytest.skip(f"no measured logs in {folder}: set FURUTA_DATA to the folder that holds qube_darmstadt/")
    return folder
