"""The command line from inside a test: `furuta(...)` runs a command, `refused` says what a refusal must be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from typer.testing import CliRunner, Result

from experiments.cli import app


def furuta(*arguments: object) -> Result:
    """`furuta ...` in this process."""
    return CliRunner().invoke(app, [str(a) for a in arguments])


def refused(result: Result, *words: str) -> None:
    """Exit 2, all words on stderr, nothing on stdout, no traceback."""
    assert result.exit_code == 2, result.output
    for word in words:
        assert word in result.stderr
    assert "Traceback" not in result.output
    assert result.stdout == ""


def some_log(path: Path, n: int = 400, **columns: object) -> Path:
    """A small log file that reads without complaint, with columns replaced."""
    t = 0.002 * np.arange(n)
    q2 = 0.05 * (np.sin(5 * t) + np.sin(11 * t) + np.sin(23 * t))  # no pendulum, so that nothing is said of its zero
    table = {"t": t, "q1": 0.1 * np.sin(3 * t), "q2": q2, "u": np.sign(np.sin(9 * t))} | columns
    rows = [",".join(str(v) for v in row) for row in zip(*table.values(), strict=True)]
    path.write_text("\n".join([",".join(table), *rows]) + "\n")
    return path
