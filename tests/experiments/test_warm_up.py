"""Compiling once: it is announced when it happens, `furuta warm-up` does it, and help waits for none of it."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from experiments.demo import warm_up
from furuta_gym import cache_folder
from tests.commands import furuta

LOADED = """
import sys
from experiments.cli.app import app
try:
    app(["identify", "--help"])
except SystemExit:
    pass
print("LOADED", *sorted({"numba", "numpy", "scipy", "gymnasium", "matplotlib"} & set(sys.modules)), file=sys.stderr)
"""


def test_help_loads_no_library_of_numbers() -> None:
    """What `identify --help` waits for is typer alone; so it takes a third of a second of a processor."""
    shown = subprocess.run([sys.executable, "-c", LOADED], capture_output=True, text=True, timeout=60)
    assert "--all" in shown.stdout
    assert shown.stderr.split() == ["LOADED"]


def test_compiling_is_announced_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """By a function that is compiled here, in the middle of a command."""
    from furuta_gym.plant.compiled import compiled

    made = []

    def step() -> None:
        for k in range(2):
            made.append(compiled(lambda x, k=k: x + k, cache=False)(1.0))

    monkeypatch.setattr(warm_up, "STEPS", {"a step": step})
    result = furuta("warm-up")
    assert result.exit_code == 0, result.output
    assert made == [1.0, 2.0]
    assert result.stderr.count("Compiling for this machine") == 1
    assert "Compiled, and kept in" in result.stdout


def test_nothing_is_announced_where_nothing_is_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(warm_up, "STEPS", {"a step": lambda: None})
    result = furuta("warm-up")
    assert "Compiling" not in result.stderr
    assert "Nothing was left to compile" in result.stdout
    assert cache_folder._listeners == []


@pytest.mark.thorough
def test_after_it_nothing_is_left() -> None:
    """Every kernel that warming up uses is kept: a second time compiles nothing."""
    run = [sys.executable, "-m", "furuta_command", "warm-up"]
    first = subprocess.run(run, capture_output=True, text=True, timeout=600)
    assert first.returncode == 0, first.stderr
    again = subprocess.run(run, capture_output=True, text=True, timeout=600)
    assert "Nothing was left to compile" in again.stdout
    assert "Compiling" not in again.stderr


def test_what_was_compiled_is_told_to_machines(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(warm_up, "STEPS", {"a step": lambda: None})
    result = furuta("warm-up", "--json")
    assert result.exit_code == 0, result.output
    facts = json.loads(result.stdout)
    assert facts["compiled"] == 0
    assert facts["seconds"] >= 0
    assert facts["kept_in"] == (str(root) if (root := cache_folder.cache_root()) else None)


def test_what_was_compiled_before_it_was_stopped_is_said_to_stay(monkeypatch: pytest.MonkeyPatch) -> None:
    def stop() -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(warm_up, "STEPS", {"a step": stop})
    result = furuta("warm-up")
    assert result.exit_code == 130
    assert "Interrupted. What was compiled is kept" in result.stderr
