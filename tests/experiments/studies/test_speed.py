"""The benchmark runs, and what the env's docstring says of its integration error holds."""

import json

import pytest
from rich.console import Console

from experiments.studies.speed import SETTINGS, Arguments, run, show
from furuta_gym.envs import ENV_ID


@pytest.fixture(scope="module")
def results():
    return run(Arguments.quick())


def test_integration_error_is_as_documented(results):
    assert len(results.integration) == 12
    for row in results.integration:
        gentle, hanging = row["command"] == 0.1, row["task"] == "swing_up"
        limit = (0.02 if gentle else 0.4) if hanging else (0.06 if gentle else 3.0)
        assert row["rms_counts"] < limit, row
        assert row["substeps"] >= 2


def test_faster_than_python_physics_by_processor_time(results):
    """Far inside what `make bench` measures, since tests share their machine."""
    ours = results.single[ENV_ID].cpu_ns
    assert ours < results.single["Pendulum-v1"].cpu_ns
    assert ours < results.single["Acrobot-v1"].cpu_ns / 2
    assert results.vector[ENV_ID].cpu_ns < ours / 4


def test_memory_is_flat(results):
    assert results.memory_mb["after"] - results.memory_mb["before"] < 10


def test_report_and_json(results, capsys):
    show(results, Console(width=120))
    printed = capsys.readouterr().out
    for name in SETTINGS:
        assert name in printed
    assert json.loads(results.to_json())["kernel_ns"]["alone"] > 0
