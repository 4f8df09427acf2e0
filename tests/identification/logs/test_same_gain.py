"""Logs of one pendulum in which the command does not do the same: the proposal says so, and only then."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from experiments.bench import Rig
from identification.logs.log import Log
from identification.logs.proposal import propose
from identification.logs.table import Table
from tests.commands import furuta
from tests.factories import bench_log, hanging_log, loop_log


def notes(*logs: Log, scale: float = 1.0) -> list[str]:
    """What is said of the command of several logs; of the last, the command was recorded `scale` times too large."""
    tables = [
        Table(f"log{i}.csv", {"t": log.t, "q1": log.q1, "q2": log.q2, "u": log.u * (scale if i else 1.0)})
        for i, log in enumerate(logs)
    ]
    found = propose(tables)
    assert not found.fatal
    return [str(problem) for problem in found.problems if "does" in problem.text]


@cache
def of_one_rig(experiment: str) -> Log:
    return bench_log(Rig("servo"), experiment, 3, 8.0)


@pytest.mark.parametrize("scale", [0.5, 2.0, 1000.0, 0.001, 255.0])  # the last three: mV beside V, a duty beside V
def test_a_command_of_another_scale_is_told_with_its_factor(scale: float) -> None:
    first, second = (loop_log(duration=5.0, T=0.004, seed=seed)[0] for seed in (0, 1))
    (note,) = notes(first, second, scale=scale)
    factor = float(note.partition("does ")[2].split()[0])
    assert factor == pytest.approx(1.0 / scale, rel=0.1)
    assert "log1.csv" in note
    assert "times what that of log0.csv does" in note
    assert "supply, the driver and the command's scale" in note


@pytest.mark.parametrize("experiments", [("paper", "paper"), ("paper", "wide"), ("paper", "hanging-chirp")])
def test_logs_of_one_rig_pass(experiments: tuple[str, str]) -> None:
    first, second = experiments
    assert notes(of_one_rig(first), bench_log(Rig("servo"), second, 4, 8.0)) == []


def test_a_free_decay_says_nothing_of_the_command() -> None:
    still = hanging_log()
    assert notes(still, Log(still.t, still.q1, still.q2, np.zeros(len(still)), still.input_unit)) == []


def test_init_writes_the_note_and_its_file(tmp_path: Path) -> None:
    for i, scale in enumerate((1.0, 0.5)):
        log = loop_log(duration=5.0, T=0.004, seed=i)[0]
        table = np.column_stack([log.t, log.q1, log.q2, scale * log.u])
        np.savetxt(tmp_path / f"log{i}.csv", table, delimiter=",", header="t,q1,q2,u [V]", comments="")
    result = furuta("init", tmp_path / "log0.csv", tmp_path / "log1.csv")
    assert result.exit_code == 0, result.output
    assert "Note: the command of log1.csv does 2" in " ".join(result.stdout.split())
    assert (tmp_path / "rig.toml").exists()
