"""What every test shares: deterministic hypothesis, the parts of the tests, and the measured logs where they are."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

ROOT = Path(__file__).resolve().parent.parent
PARTS = ("thorough", "slow")
"""Parts of the tests, each listed in a file of its name. A test of neither is fast, one of both is thorough."""

TOGETHER = ("tests/experiments/report/", "tests/experiments/studio/")
"""Folders whose modules share fits that take long: each worker that runs one of them would fit anew."""

# Compilation happens inside the first example, so deadlines would measure the compiler.
settings.register_profile(
    "furuta", derandomize=True, deadline=None, database=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("furuta")


def _listed(part: str) -> list[str]:
    """Entries of tests/PART.txt, files or tests."""
    lines = (ROOT / "tests" / f"{part}.txt").read_text(encoding="utf-8").splitlines()
    return [line for line in lines if line and not line.startswith("#")]


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """The fast part does not import what is slow as a whole."""
    if "not slow" in config.option.markexpr and collection_path.suffix == ".py":
        return collection_path.relative_to(ROOT).as_posix() in _listed("slow") or None
    return None


@pytest.hookimpl(tryfirst=True)  # before -m selects
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark what the lists of the parts name, in their order. Raises pytest.UsageError for an entry that is no test."""
    levels = [_levels(item) for item in items]
    for part in PARTS:
        listed = set(_listed(part))
        for item, names in zip(items, levels, strict=True):
            if listed.intersection(names) and not any(item.iter_markers("thorough")):
                item.add_marker(part)
        found = listed.intersection(name for names in levels for name in names)
        files = {names[0] for names in levels}
        stale = [entry for entry in sorted(listed - found) if entry.split("::")[0] in files]
        if stale and not any("::" in argument for argument in config.args):
            raise pytest.UsageError(f"tests/{part}.txt lists what is no test: {', '.join(stale)}")
    order = dict.fromkeys(entry.split("::")[0] for part in reversed(PARTS) for entry in _listed(part))
    rank = {file: i for i, file in enumerate(order)}
    items.sort(key=lambda item: rank.get(item.nodeid.split("::")[0], len(rank)))


@pytest.hookimpl(optionalhook=True)  # where pytest-xdist is
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """With `--dist loadscope` one worker gets all modules of a folder of TOGETHER, another module goes by itself."""
    if config.getoption("dist") != "loadscope":
        return None
    from xdist.scheduler import LoadScopeScheduling

    class ByFolder(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return next((folder for folder in TOGETHER if nodeid.startswith(folder)), super()._split_scope(nodeid))

    return ByFolder(config, log)


def _levels(item: pytest.Item) -> list[str]:
    """What an entry of a list may call a test: its file, its class there, itself with all its cases, or one case."""
    file, *names = item.nodeid.split("[")[0].split("::")
    return list(dict.fromkeys(["::".join([file, *names[:depth]]) for depth in range(len(names) + 1)] + [item.nodeid]))


@pytest.fixture(scope="session")
def real_data() -> Path:
    """Folder of the measured logs (FURUTA_DATA, else ../shared/data beside the repository)."""
    named = os.environ.get("FURUTA_DATA")
    folder = Path(named) if named else ROOT.parent / "shared" / "data"
    if not any(folder.glob("*/*.csv")):
        pytest.skip(f"no measured logs in {folder}: set FURUTA_DATA to the folder that holds qube_darmstadt/")
    return folder
