"""`furuta excite`: the command file, its facts, and errors as sentences."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from experiments.cli.app import app
from furuta_gym.plant import TABLE_3, THETA_NAMES, Covariance, Plant
from identification.design.next_experiment import doubt

SHORT = ["--plant", "table3", "--sample-time", "0.005", "--duration", "3"]


def run(*arguments: str):
    return CliRunner().invoke(app, ["excite", *arguments])


def test_a_design_is_written_with_what_it_promises(tmp_path: Path) -> None:
    path = tmp_path / "u.csv"
    result = run(*SHORT, "--limits", "q1=0.8,q2=0.2", "-o", str(path), "--json")
    assert result.exit_code == 0, result.output
    answer = json.loads(result.stdout)
    assert answer["column"] == "d"
    assert answer["gain"] >= 1.0
    assert answer["largest"]["q2"] <= 0.2
    lines = path.read_text(encoding="utf-8").splitlines()
    facts = dict(line[2:].split(": ", 1) for line in lines if line.startswith("#"))
    assert facts["controller"] == "paper-lqr"
    assert float(facts["predicted_std_theta1"]) == pytest.approx(answer["predicted"]["theta1"]["std"], rel=1e-3)
    header = next(i for i, line in enumerate(lines) if line == "t,d")
    table = np.loadtxt(lines[header + 1 :], delimiter=",")
    assert table.shape == (600, 2)
    assert np.diff(table[:, 0]) == pytest.approx(0.005)


def test_an_experiment_between_two_effects_is_written(tmp_path: Path) -> None:
    path = tmp_path / "u.csv"
    result = run(*SHORT, "--controller", "none", "--between", "arm_spring,input_offset", "-o", str(path))
    assert result.exit_code == 0, result.output
    assert "arm_spring" in result.stdout
    assert "nats" in result.stdout
    assert "t,u" in path.read_text(encoding="utf-8").splitlines()


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["--limits", "q3=1"], "q1, q2, u, u_rate"),
        (["--limits", "q1=-1"], "positive"),
        (["--limits", "q1=0.001"], "without any excitation"),
        (["--between", "input_delay"], "two effects or more"),
        (["--between", "input_delay,gremlin"], "gremlin"),
        (["--duration", "-3"], "--duration"),
        (["--controller", "magic"], "magic"),
        (["-o", "u.txt"], "u.txt"),
    ],
)
def test_bad_input_is_a_sentence_and_exit_code_2(tmp_path: Path, arguments: list[str], word: str) -> None:
    path = tmp_path / "u.csv"
    result = run(*SHORT, "-o", str(path), *arguments)
    assert result.exit_code == 2
    assert word in result.stderr
    assert "Traceback" not in result.output
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("spread", "words"),
    [
        (None, ("no error bars", "design again")),
        ({"theta1": 0.01, "theta3": 0.12, "theta8": 0.4}, ("theta3 ± 12 %, theta8 ± 40 %", "design again")),
        ({"theta1": 0.04, "theta2": 0.3, "theta9": 0.3}, ()),
    ],
)
def test_a_plant_that_is_poorly_known_is_warned_about_before_the_design(
    spread: dict[str, float] | None, words: tuple[str, ...], tmp_path: Path
) -> None:
    rig = Plant.resolve("table3")
    if spread is not None:
        theta = dict(zip(THETA_NAMES, rig.theta, strict=True))
        std = [share * theta[name] for name, share in spread.items()]
        rig = rig.replace(covariance=Covariance(tuple(spread), np.diag(np.square(std))))
    path = rig.save(tmp_path / "rig.json")
    result = run("--plant", str(path), *SHORT[2:], "-o", str(tmp_path / "u.csv"), "--limits", "q1=0.001")
    assert result.exit_code == 2, "the design itself, which takes long, is refused"
    assert result.stderr.count("Warning: ") == bool(words)
    for word in words:
        assert word in result.stderr


def test_a_parameter_that_is_not_identified_has_no_percentage_in_the_warning() -> None:
    theta3 = float(TABLE_3.theta[2])
    rig = TABLE_3.replace(
        covariance=Covariance(("theta1", "theta3"), np.diag([0.0, (9.0 * theta3) ** 2])),
        checks={"identifiability": {"not_identified": ["theta3"]}},
    )
    assert "poorly known (theta3 not identified;" in doubt(rig)
