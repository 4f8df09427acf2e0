"""The blind trials: plan, seal, run; the examinee here is a simple one, because the trials are what is tested."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from experiments.bench import catalogue, effect_size
from experiments.cli import app
from experiments.report import Examination
from experiments.trials import decide as examinee
from experiments.trials import rounding as plain
from experiments.trials import run as running
from experiments.trials import seal as laboratory
from experiments.trials.plan import make_plan
from experiments.trials.report import FILES
from experiments.trials.run import ANSWERS, SEALED, read_results, run_trials
from experiments.trials.trial import Trial
from furuta_gym.files import locked
from furuta_gym.plant import TABLE_3
from identification.diagnosis.diagnose import diagnose
from identification.logs.log import write_log
from tests.factories import loop_log
from tests.identification.diagnosis.fits import a_diagnosis

LIBRARY = [name for name, e in catalogue().items() if e.kind == "library"]


def what_is_there(folder: Path) -> dict[str, Any]:
    """An examinee that tells what it was given and names nothing."""
    files = {file.name: file.read_text() for file in folder.iterdir()}
    return {"verdict": "none", "effects": [], "files": files, "folder": str(folder), "runtime_s": 0.1}


def without_logs(folder: Path) -> dict[str, Any]:
    """An examinee for workers elsewhere: it counts lines."""
    lines = len((folder / "fit.csv").read_text().splitlines())
    return {"verdict": "none", "effects": [], "lines": lines, "runtime_s": 0.1}


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Logs of 1 s, and strengths as the table of sizes guesses them."""
    monkeypatch.setattr(laboratory, "DURATION", 1.0)
    monkeypatch.setattr(laboratory, "_measured", lambda trial, hidden, strength: hidden.ratio)


def few(**more: Any) -> list[Trial]:
    """A library trial, one with two effects and one with nothing."""
    plan = make_plan(seeds=1, rigs=["servo"], **more)
    return [next(t for t in plan if t.kind == kind) for kind in ("library", "two", "none")]


def test_the_zeros_of_a_held_out_log_are_those_of_the_trial(short, tmp_path):
    trial = next(t for t in make_plan(rigs=["servo"], effects=["arm_spring"]) if t.kind == "strong")
    trial = replace(trial, hidden=(), held_out="free-decay")  # no command: the encoder is all that differs
    files = []
    for zeros in ((0.0, 0.0), (0.25, 0.0)):
        sealed = json.loads(json.dumps(laboratory.seal(replace(trial, zeros=zeros))))
        (folder := tmp_path / str(zeros[0])).mkdir()
        laboratory.write_logs(sealed, folder)
        files.append([np.loadtxt(folder / name, delimiter=",", skiprows=5) for name in ("fit.csv", "held_out.csv")])
    assert np.array_equal(files[0][0], files[1][0])
    away = files[1][1][:, 1] - files[0][1][:, 1]
    assert away == pytest.approx(np.full(len(away), 0.25), abs=2.1 * math.pi / 4096)


def test_rounding_is_all_that_the_plain_laboratory_adds(tmp_path, monkeypatch):
    monkeypatch.setattr(plain, "DURATION", 2.0)
    plan = make_plan("final", seeds=1, kinds=["rounding"])
    assert len(plan) == 24
    assert {t.experiment for t in plan} == {"hanging", "upright"}
    sealed = json.loads(json.dumps(laboratory.seal(plan[0])))
    laboratory.write_logs(sealed, tmp_path)
    for name in ("fit.csv", "held_out.csv"):
        log = np.loadtxt(tmp_path / name, delimiter=",", skiprows=5)
        counts = log[:, 1:3] * sealed["plain"]["counts"] / (2.0 * math.pi)
        assert np.abs(counts - np.round(counts)).max() < 1e-3
        assert np.ptp(log[:, 2]) > 0.01
    assert sealed["truth"]["effects"] == []


def test_the_strength_is_fitted_to_the_ratio_on_the_rig_itself():
    trial = next(t for t in make_plan(effects=["input_dead_zone"], rigs=["workshop"]) if t.kind == "library")
    trial = replace(trial, hidden=(replace(trial.hidden[0], ratio=1.8),), friction="smooth")
    sealed = laboratory.seal(trial)
    assert sealed["ratios"][0] - 1 == pytest.approx(0.8, rel=0.45)
    rig = laboratory._rig(trial, sealed["strengths"])
    assert effect_size(rig, trial.experiment, trial.seed, 20.0).ratio == pytest.approx(sealed["ratios"][0])
    assert sealed["truth"]["effects"][0]["name"] == "input_dead_zone"
    assert sealed["truth"]["theta"] != laboratory._rig(replace(trial, individual=5), [1.0]).truth()["theta"]


def test_the_examinee_sees_two_logs_and_no_truth(short, tmp_path):
    run_trials(few(), tmp_path, decide=what_is_there)
    results = read_results(few(), tmp_path)
    assert len(results) == 3
    for sealed, answer in results:
        assert set(answer["files"]) == {"fit.csv", "held_out.csv"}
        for text in answer["files"].values():
            head = [line for line in text.splitlines() if line.startswith("#")]
            assert [line.split(":")[0] for line in head] == [
                "# input_unit",
                "# pendulum_zero",
                "# encoder_counts",
                "# device",
            ]
            assert "# device: bench rig" in head
            rows = [line for line in text.splitlines() if not line.startswith("#")]
            assert rows[0] == "t,q1,q2,u"
            assert all(len(row.split(",")) == 4 for row in rows)
        secrets = [sealed["trial"]["id"], sealed["trial"]["kind"], *(h["name"] for h in sealed["trial"]["hidden"])]
        assert not any(secret in text for secret in secrets for text in (*answer["files"].values(), answer["folder"]))
        assert not Path(answer["folder"]).exists()
        assert not Path(answer["folder"]).is_relative_to(tmp_path), "the sealed truth lies elsewhere"


def test_the_examinee_loads_nothing_of_the_bench():
    loaded = "import sys, experiments.trials.decide; print(*(m for m in sys.modules if m.startswith('experiments')))"
    names = subprocess.run([sys.executable, "-c", loaded], capture_output=True, text=True, check=True).stdout.split()
    assert "experiments.trials.decide" in names
    assert not [n for n in names if n.startswith("experiments.bench") or n.endswith((".plan", ".seal", ".scoring"))]


def test_the_same_trial_gives_the_same_logs(short, tmp_path):
    sealed = laboratory.seal(few()[0])
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        laboratory.write_logs(json.loads(json.dumps(sealed)), tmp_path / name)
    for log in ("fit.csv", "held_out.csv"):
        assert (tmp_path / "a" / log).read_bytes() == (tmp_path / "b" / log).read_bytes()
    assert (tmp_path / "a/fit.csv").read_bytes() != (tmp_path / "a/held_out.csv").read_bytes()


def test_a_stopped_run_goes_on_and_loses_nothing(short, tmp_path):
    plan = few()
    counted: list[Path] = []

    def tired(folder: Path) -> dict[str, Any]:
        counted.append(folder)
        if len(counted) == 3:
            raise KeyboardInterrupt
        return without_logs(folder)

    with pytest.raises(KeyboardInterrupt):
        run_trials(plan, tmp_path, decide=tired)
    first = (tmp_path / ANSWERS).read_text()
    kept = len(first.splitlines())
    assert 1 <= kept < 3
    sealed = (tmp_path / SEALED).read_bytes()
    with open(tmp_path / ANSWERS, "a") as file:
        file.write('{"id": "cut o')  # as if the machine had stopped while writing
    seen: list[tuple[str, int, int]] = []
    run_trials(plan, tmp_path, progress=lambda *told: seen.append(told), decide=without_logs)
    text = (tmp_path / ANSWERS).read_text()
    assert text.startswith(first)
    whole = [line for line in text.splitlines() if line != '{"id": "cut o']
    assert sorted(json.loads(line)["id"] for line in whole) == sorted(t.id for t in plan)
    assert (tmp_path / SEALED).read_bytes() == sealed
    assert seen[-1] == ("deciding", 3 - kept, 3 - kept)


def test_a_rig_that_always_falls_is_told_apart(short, tmp_path, monkeypatch):
    from experiments.bench import PendulumLost

    def falls(*arguments: Any) -> None:
        raise PendulumLost("falls", None)  # type: ignore[arg-type]

    monkeypatch.setattr(laboratory, "record", falls)
    run_trials(few(), tmp_path, decide=without_logs)
    assert read_results(few(), tmp_path) == []
    assert len(running.read_unanswerable(few(), tmp_path)) == 3


def test_an_examinee_that_crashes_has_given_an_answer(tmp_path):
    answer = examinee.decide(tmp_path)
    assert "fit.csv" in answer["error"]
    assert answer["runtime_s"] >= 0


@pytest.mark.parametrize(("held_out", "verdict"), [("arm_spring", "named"), (None, "unknown")])
def test_the_examinee_gives_the_verdict_of_the_command(tmp_path, held_out, verdict):
    """A cable is found in fit.csv; a held_out.csv of a rig without one takes the name back."""
    logs = loop_log("arm_spring", duration=6.0)[0], loop_log(held_out, duration=4.0, seed=1)[0]
    for name, log in zip(("fit.csv", "held_out.csv"), logs, strict=True):
        write_log(tmp_path / name, log)
    found: list[Any] = []

    def small(searched: Any, held: Any) -> Any:
        found.append(diagnose(searched, held, TABLE_3, most=1, only=["arm_spring"]))
        return found[0]

    answer = examinee.decide(tmp_path, small)
    assert answer["verdict"] == verdict, answer
    command = Examination(found[0], (), (), None, None, None, None, None, {}, 0.0).to_dict()
    assert {key: answer[key] for key in ("verdict", "effects", "gap")} == {
        key: command[key] for key in ("verdict", "effects", "gap")
    }
    assert answer["gap"]["held_out"] is True
    assert "gap_missing" not in answer


def test_the_examinee_says_why_there_is_no_gap(tmp_path):
    for name in ("fit.csv", "held_out.csv"):
        write_log(tmp_path / name, loop_log(duration=1.0)[0])
    found = a_diagnosis("arm_spring", rest=None, gap_remark="too short")
    answer = examinee.decide(tmp_path, lambda *logs: found)
    assert (answer["verdict"], answer["gap"], answer["gap_missing"]) == ("named", None, "too short")


def test_processes_of_dask_give_the_same_answers(short, tmp_path):
    pytest.importorskip("distributed")
    plan = few()
    run_trials(plan, tmp_path / "here", decide=without_logs)
    # sealed here: workers elsewhere would not know of the short logs
    (tmp_path / "there").mkdir()
    (tmp_path / "there" / SEALED).write_bytes((tmp_path / "here" / SEALED).read_bytes())
    run_trials(plan, tmp_path / "there", backend="dask", jobs=1, decide=without_logs)

    def answers(name: str) -> list[tuple[str, int]]:
        return sorted((a["id"], a["lines"]) for _, a in read_results(plan, tmp_path / name))

    assert len(answers("there")) == 3
    assert answers("there") == answers("here")


def test_another_backend_is_refused(tmp_path):
    with pytest.raises(ValueError, match="loky, dask"):
        run_trials([], tmp_path, backend="slurm")


def test_the_command_writes_all_its_files(short, tmp_path, monkeypatch):
    pytest.importorskip("plotly")
    plan = make_plan(seeds=1, effects=["arm_spring", "input_delay"], rigs=["servo"], kinds=["library", "none"])
    run_trials(plan, tmp_path, decide=without_logs)  # so that the command has only to mark
    arguments = ["--effects", "arm_spring,input_delay", "--rigs", "servo", "--kinds", "library,none", "--seeds", "1"]
    result = CliRunner().invoke(app, ["trials", *arguments, "--jobs", "1", "-o", str(tmp_path), "--json"])
    assert result.exit_code == 0, result.output
    summary = json.loads(result.stdout)
    assert summary["run"]["answered"] == len(plan) == 4
    assert summary["library"]["results"]["missed"]["count"] == 2
    assert summary["false_alarms"]["count"] == 0
    assert all((tmp_path / name).stat().st_size > 50 for name in FILES)
    page = (tmp_path / "report.html").read_text()
    assert "arm_spring" in page
    assert "nothing to name: false alarms" in page


def test_the_command_refuses_what_it_does_not_know(tmp_path):
    result = CliRunner().invoke(app, ["trials", "--effects", "arm_sprung", "-o", str(tmp_path / "out")])
    assert result.exit_code == 2
    assert "arm_sprung" in result.stderr
    assert not (tmp_path / "out").exists()


def test_answers_are_never_written_again(tmp_path: Path, short: None) -> None:
    """A line that was cut off, or spoiled, is passed over and asked again; all other bytes stay."""
    plan = few()
    run_trials(plan, tmp_path, decide=what_is_there)
    file = tmp_path / ANSWERS
    first, second, third = file.read_bytes().splitlines(keepends=True)
    spoiled = b"\xff" + first + second + third[: len(third) // 2]
    file.write_bytes(spoiled)
    run_trials(plan, tmp_path, decide=what_is_there)
    assert file.read_bytes().startswith(spoiled + b"\n")
    assert len(read_results(plan, tmp_path)) == 3
    assert file.read_bytes().count(b"\n") == 5


def test_one_folder_has_one_run(tmp_path: Path) -> None:
    with locked(tmp_path), pytest.raises(ValueError, match="being written by another furuta"):
        run_trials(few(), tmp_path, decide=what_is_there)
