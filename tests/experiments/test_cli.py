"""The command line: every kind of bad input gives exit 2 and a sentence; the commands fit together."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest
import typer

from experiments.cli import app
from experiments.cli.options import with_effects
from furuta_gym.plant import PAPER_GAIN, TABLE_3, Plant
from identification.logs.log import write_log
from identification.logs.reading import read_log, read_logs
from tests.commands import furuta, refused, some_log


@pytest.fixture(scope="module")
def rig(recorded: Path) -> Path:
    """A plant file identified from the first 4 seconds of that log."""
    short = recorded.with_name("short.csv")
    short.write_text("".join(recorded.read_text().splitlines(keepends=True)[:2010]))
    path = recorded.with_name("rig.json")
    result = furuta("identify", short, "-o", path, "--start", "table3", "--fix", "r=100")
    assert result.exit_code == 0, result.output
    assert "Verdict" in result.stdout
    return path


def spoilt(values: np.ndarray, at: int, value: object) -> list[object]:
    return [*values[:at].tolist(), value, *values[at + 1 :].tolist()]


T = 0.002 * np.arange(400)
BAD_LOGS = {
    "text": ({"q2": spoilt(0.1 * np.sin(5 * T), 7, "oops")}, ("oops", "q2", "line 9")),
    "nan": ({"q1": spoilt(0.1 * np.sin(3 * T), 5, "nan")}, ("NaN", "q1", "line 7")),
    "backwards": ({"t": spoilt(T, 30, 0.001)}, ("time runs backwards", "line 32")),
    "constant command": ({"u": np.ones(400)}, ("command u is 1 in every sample",)),
}


@pytest.mark.parametrize("name", BAD_LOGS)
def test_bad_logs_are_refused_and_nothing_is_written(tmp_path: Path, name: str) -> None:
    columns, words = BAD_LOGS[name]
    log = some_log(tmp_path / "log.csv", **columns)
    refused(furuta("identify", log, "-o", tmp_path / "rig.json"), "Error:", "log.csv", *words)
    assert [p.name for p in tmp_path.iterdir()] == ["log.csv"]


def test_missing_file(tmp_path: Path) -> None:
    refused(furuta("identify", tmp_path / "none.csv", "-o", tmp_path / "rig.json"), "none.csv", "does not exist")
    assert not list(tmp_path.iterdir())


def test_missing_column(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    log.write_text("t,q1,q2\n" + "".join(f"{0.002 * k},0,0\n" for k in range(100)))
    refused(furuta("identify", log, "-o", tmp_path / "rig.json"), "log.csv", "column", "--columns")
    assert [p.name for p in tmp_path.iterdir()] == ["log.csv"]


def test_two_samples(tmp_path: Path) -> None:
    log = some_log(tmp_path / "log.csv", n=2)
    refused(furuta("identify", log, "-o", tmp_path / "rig.json"), "2 samples")
    assert [p.name for p in tmp_path.iterdir()] == ["log.csv"]


def test_unknown_option(tmp_path: Path) -> None:
    result = furuta("identify", "log.csv", "-o", tmp_path / "rig.json", "--colums", "t=Time")
    assert result.exit_code == 2
    assert "--colums" in result.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("identify", "LOG", "-o", "rig.txt"), ".json"),
        (("identify", "LOG", "-o", "rig.json", "--prior", "theta2=0.01"), "±"),
        (("identify", "LOG", "-o", "rig.json", "--fix", "theta4=x"), "theta4"),
        (("identify", "LOG", "-o", "rig.json", "--flip", "q3"), "q3"),
        (("identify", "LOG", "-o", "rig.json", "--start", "tabel3"), "table3"),
        (("identify", "LOG", "-o", "rig.json", "--method", "ekf", "--fix", "r=100"), "prediction-error"),
        (("validate", "none.json", "LOG"), "none.json"),
        (("identify", "LOG", "-o", "x.json", "--skip", "100"), "the log runs from"),
        (("diagnose", "LOG", "-o", "x", "--skip", "-1"), "--skip"),
        (("identify", "LOG", "-o", "x.json", "--cut", "100:101"), "no sample lies"),
        (("validate", "qube", "LOG", "--cut", "2:1"), "--cut 2:1"),
        (("simulate", "--plant", "none.json", "-o", "x.csv"), "none.json"),
        (("simulate", "--plant", "table3", "-o", "x.csv", "--duration", "0"), "--duration"),
        (("simulate", "--plant", "table3", "-o", "x.csv", "--controller", "lqrr"), "did you mean lqr"),
        (("simulate", "--plant", "table3", "-o", "x.csv", "--excitation", "sine"), "multisine"),
        (("simulate", "--plant", "table3", "-o", "x.csv", "--excitation", "missing.csv"), "missing.csv"),
        (("simulate", "--plant", "table3", "-o", "x.csv", "--effect", "spring"), "arm_spring"),
        (("simulate", "--plant", "table3", "-o", "x.csv", "--effect", "arm_spring:c=1"), "q1n"),
        (("simulate", "--plant", "table3", "-o", "x.csv", "--printed-sign"), "paper-lqr"),
        (("compare", "--plant", "table3", "-o", "DIR", "--controllers", "nothing"), "nothing"),
        (
            ("compare", "--plant", "table3", "-o", "DIR", "--controllers", "lqr", "--groups", "wind"),
            "--groups 'wind': expected of balance",
        ),
        (("bench", "record", "--rig", "rig-00", "-o", "x.csv"), "rig-00"),
    ],
)
def test_bad_arguments(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...], word: str) -> None:
    monkeypatch.chdir(tmp_path)
    some_log(tmp_path / "LOG.csv")
    refused(furuta(*(a.replace("LOG", "LOG.csv") for a in arguments)), "Error:", word)
    assert [p.name for p in tmp_path.iterdir()] == ["LOG.csv"]


@pytest.mark.filterwarnings("ignore:.*zero or signs")
def test_the_start_of_a_log_is_left_out_on_request(tmp_path: Path) -> None:
    paths = [some_log(tmp_path / f"{name}.csv") for name in "ab"]
    for log, short in zip(read_logs(paths), read_logs(paths, skip=0.25), strict=True):
        assert short.t[0] == pytest.approx(log.t[0] + 0.25, abs=log.sample_time)
        assert short.t[-1] == log.t[-1]
        assert (log.skipped, short.skipped) == (0.0, 0.25)


def test_an_output_that_is_an_input_is_refused(tmp_path: Path) -> None:
    plant = TABLE_3.save(tmp_path / "rig.json")
    before = plant.read_bytes()
    log = some_log(tmp_path / "log.csv")
    refused(furuta("validate", plant, log, "--json", plant), "input")
    assert plant.read_bytes() == before


def test_an_interrupted_write_leaves_the_old_file(tmp_path: Path) -> None:
    from experiments.cli.output import write_json

    path = tmp_path / "x.json"
    write_json(path, {"a": 1})
    with pytest.raises(ValueError, match="JSON"):
        write_json(path, {"a": float("nan")})
    assert json.loads(path.read_text()) == {"a": 1}
    assert [p.name for p in tmp_path.iterdir()] == ["x.json"]


def test_paper_controller_keeps_the_pendulum_up_under_the_papers_excitation(recorded: Path) -> None:
    figures = json.loads(recorded.with_suffix(".json").read_text())
    assert figures["fell_at_s"] is None
    assert figures["duration_s"] == pytest.approx(20, abs=0.01)
    assert figures["max_abs_q2"] < 0.2
    log = read_log(recorded)
    assert np.abs(log.q2).max() < 0.2
    assert log.encoder_counts == (4096, 4096)
    assert log.input_unit == "V"
    assert log.controller_gain == pytest.approx(tuple(PAPER_GAIN))


def test_the_printed_sign_falls(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    arguments = ("--plant", "table3", "--controller", "paper-lqr", "--excitation", "paper", "-o", path)
    result = furuta("simulate", *arguments, "--printed-sign")
    assert result.exit_code == 0
    assert "FELL" in result.stdout
    log = read_log(path)
    assert log.duration < 2
    assert np.abs(log.q2).max() > 0.9
    assert log.controller_gain == pytest.approx(tuple(-PAPER_GAIN))


def test_the_gain_written_is_the_gain_played(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    arguments = ("--plant", "table3", "--controller", "lqr", "--encoder-counts", 0, "--duration", 2, "-o", path)
    assert furuta("simulate", *arguments).exit_code == 0
    log = read_log(path)
    assert log.encoder_counts is None
    K = np.array(log.controller_gain)
    # the causal filtered difference with its corner at 100 rad/s, as the controller has it
    v, g = np.zeros((len(log), 2)), 1 - np.exp(-100 * log.sample_time)
    for k in range(1, len(log)):
        v[k] = v[k - 1] + g * ((log.angles[k] - log.angles[k - 1]) / 0.002 - v[k - 1])
    expected = -(K[0] * log.q1 + K[1] * v[:, 0] + K[2] * log.q2 + K[3] * v[:, 1])
    assert log.u == pytest.approx(expected, abs=1e-8)


def test_simulations_repeat_with_the_seed(tmp_path: Path) -> None:
    paths = [tmp_path / f"{i}.csv" for i in range(3)]
    for path, seed in zip(paths, (4, 4, 5), strict=True):
        arguments = ("--controller", "lqr", "--excitation", "prbs", "--noise", "1e-3", "--duration", 1, "--seed", seed)
        assert furuta("simulate", "--plant", "qube", *arguments, "-o", path).exit_code == 0
    assert paths[0].read_text() == paths[1].read_text()
    assert paths[0].read_text() != paths[2].read_text()


@pytest.mark.parametrize("T", ["0.002", "0.0037", "0.01"])
def test_stamps_of_a_simulation_are_whole_samples(tmp_path: Path, T: str) -> None:
    """0.006, never 0.006000000000000001."""
    log = tmp_path / "log.csv"
    arguments = ("--plant", "table3", "--controller", "none", "--start", "hanging", "--excitation", "chirp")
    done = furuta("simulate", *arguments, "--sample-time", T, "--duration", 3, "-o", log)
    assert done.exit_code == 0, done.output
    rows = log.read_text().split("t,q1,q2,u\n")[1].splitlines()
    stamps = [row.partition(",")[0] for row in rows]
    assert [Decimal(stamp) for stamp in stamps] == [k * Decimal(T) for k in range(len(stamps))]


@pytest.mark.parametrize(("plant", "told"), [("qube", True), ("table3", False)])
def test_the_paper_s_gain_on_another_rig_is_remarked(tmp_path: Path, plant: str, told: bool) -> None:
    arguments = ("--controllers", "paper-lqr,lqr", "--trials", 2, "--duration", 0.5, "--groups", "balance")
    result = furuta("compare", "--plant", plant, "-o", tmp_path / "c", *arguments)
    assert result.exit_code == 0, result.output
    assert ("paper-lqr has the gains of the paper's rig (table3), not of this plant" in result.stdout) == told
    assert f"Next: furuta export {plant} --controller lqr -o lqr.h" in result.stdout


def test_an_effect_reaches_the_simulation(tmp_path: Path) -> None:
    logs = []
    for extra in ((), ("--effect", "arm_spring:k=2.0,q1n=0.5", "--effect", "input_offset")):
        path = tmp_path / "log.csv"
        arguments = ("--plant", "large", "--excitation", "chirp", "--amplitude", 0.3, "--duration", 2, "-o", path)
        assert furuta("simulate", *arguments, *extra).exit_code == 0
        logs.append(read_log(path))
    assert np.abs(logs[0].q1 - logs[1].q1).max() > 0.1
    assert "arm_spring" in logs[1].metadata["effects"]


def test_identify_recovers_the_simulated_plant(rig: Path) -> None:
    plant = Plant.load(rig)
    assert plant.unit == "V"
    assert plant.covariance is not None
    std = np.sqrt(np.diag(plant.covariance.matrix))[:9]
    assert np.all(np.abs(plant.theta - TABLE_3.theta) < 5 * std + 1e-4 * TABLE_3.theta)
    assert plant.friction_sharpness == 100


def test_validate_round_trip(rig: Path, recorded: Path, tmp_path: Path) -> None:
    written, unseen = tmp_path / "gap.json", tmp_path / "unseen.csv"
    write_log(unseen, read_log(recorded).slice(4.0, 10.0))
    result = furuta("validate", rig, unseen, "--json", written, "--plots", tmp_path / "plots")
    assert result.exit_code == 0, result.output
    assert {path.name for path in (tmp_path / "plots").iterdir()} == {
        "predictions.png",
        "horizons.png",
        "innovations.png",
    }
    gap = json.loads(written.read_text())["gap"]
    names = "rms_q1 rms_q2 fit_percent_q1 fit_percent_q2 horizon_s noise_floor_q1 noise_floor_q2 ratio_to_floor"
    assert set(names.split()) <= set(gap)
    assert gap["ratio_to_floor"] < 1.5
    assert gap["rms_q2"] < 0.01
    wrong = Plant.load(rig).replace(theta=TABLE_3.theta * np.array([1, 1, 1, 1, 1.3, 1, 1, 1.3, 1]), covariance=None)
    other = furuta("validate", wrong.save(tmp_path / "wrong.json"), unseen, "--json", "-")
    assert other.exit_code == 0, other.output
    assert json.loads(other.stdout)["gap"]["rms_q1"] > 2 * gap["rms_q1"]


def test_compare_writes_its_figures(rig: Path, tmp_path: Path) -> None:
    arguments = ("--controllers", "paper-lqr,lqr", "--trials", 3, "--duration", 2, "--groups", "balance", "--json")
    result = furuta("compare", "--plant", rig, "-o", tmp_path / "c", *arguments)
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout) == json.loads((tmp_path / "c" / "comparison.json").read_text())
    assert (tmp_path / "c" / "comparison_balance.png").stat().st_size > 1000


def test_bench_is_mounted() -> None:
    result = furuta("bench", "list", "--json")
    assert result.exit_code == 0
    assert {"rigs", "experiments"} <= set(json.loads(result.stdout))


def test_warnings_are_readable_lines(tmp_path: Path) -> None:
    log = some_log(tmp_path / "log.csv", t=T + 0.5 * (T > 0.4))
    result = furuta("identify", log, "-o", tmp_path / "rig.json", "--method", "recursive-ls")
    assert "Warning: log.csv: 1 gap in the clock" in result.stderr
    assert "LogWarning" not in result.stderr


def test_the_installed_command_is_quick_and_leaves_no_traceback(tmp_path: Path) -> None:
    run = [sys.executable, "-c", "from experiments.cli import main; main()"]
    started = time.perf_counter()
    shown = subprocess.run([*run, "--help"], capture_output=True, text=True, timeout=60)
    assert time.perf_counter() - started < 10
    assert shown.returncode == 0
    for name in ("identify", "validate", "diagnose", "simulate", "compare", "demo", "bench"):
        assert name in shown.stdout
    code = "import sys, experiments.cli; print(sorted({'numba', 'scipy', 'matplotlib', 'pandas'} & set(sys.modules)))"
    heavy = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert heavy.stdout.strip() == "[]"
    bad = subprocess.run(
        [*run, "identify", "none.csv", "-o", "rig.json"], capture_output=True, text=True, timeout=60, cwd=tmp_path
    )
    assert bad.returncode == 2
    assert "none.csv" in bad.stderr
    assert "Traceback" not in bad.stderr


def test_milliseconds_and_plain_letters(tmp_path: Path, recorded: Path) -> None:
    """A log with `millis()` and a keyboard without Greek letters."""
    log = read_log(recorded).slice(stop=4.0)
    slow = some_log(tmp_path / "ms.csv", len(log), t=1000 * log.t, q1=log.q1, q2=log.q2, u=log.u)
    result = furuta("validate", "table3", slow, "--time-unit", "ms", "--encoder-counts", 4096)
    assert result.exit_code == 0, result.output
    assert "Prediction 0.3 s ahead" in result.stdout
    refused(furuta("validate", "table3", slow, "--time-unit", "h"), "one of s, ms, us")
    plant = with_effects(TABLE_3, ["arm_stribeck:dF=0.1"])
    assert plant.effect("arm_stribeck").parameters["ΔF"] == 0.1
    assert plant.effect("arm_stribeck").parameters["vs"] == TABLE_3.default_effect("arm_stribeck").parameters["vs"]


def test_what_is_played_is_not_overwritten(tmp_path: Path) -> None:
    d = tmp_path / "d.csv"
    d.write_text("t,u\n0,1\n")
    refused(furuta("simulate", "--plant", "table3", "--excitation", d, "-o", d), "also an input")
    assert d.read_text() == "t,u\n0,1\n"


def test_a_lone_free_decay_can_be_predicted(tmp_path: Path) -> None:
    """It tells no scale, and a prediction asks for none."""
    for start in ("upright", "hanging"):  # the second is at rest all the time
        log = tmp_path / f"{start}.csv"
        assert furuta("simulate", "--plant", "qube", "--duration", 4, "--start", start, "-o", log).exit_code == 0
        refused(furuta("identify", log, "-o", tmp_path / "rig.json"), "command")
        result = furuta("validate", "qube", log)
        assert result.exit_code == 0, result.output
        assert "Traceback" not in result.output


@pytest.mark.parametrize(
    ("words", "fitted", "held"),
    [
        ("a.csv --held-out b.csv c.csv -o d", ["a.csv"], ["b.csv", "c.csv"]),
        ("-o d a.csv b.csv --held-out c.csv d.csv --skip 1", ["a.csv", "b.csv"], ["c.csv", "d.csv"]),
        ("a.csv --held-out b.csv --held-out c.csv -o d", ["a.csv"], ["b.csv", "c.csv"]),
        ("--held-out b.csv a.csv -o d", ["a.csv"], ["b.csv"]),
        ("a.csv --held-out=b.csv -o d", ["a.csv"], ["b.csv"]),
    ],
)
def test_several_logs_may_follow_held_out(words: str, fitted: list[str], held: list[str]) -> None:
    command = typer.main.get_command(app).commands["diagnose"]  # type: ignore[attr-defined]
    given = command.make_context("diagnose", words.split()).params
    assert [str(path) for path in given["logs"]] == fitted
    assert [str(path) for path in given["held_out"]] == held


def test_the_thresholds_of_the_diagnosis_are_printed_without_a_log() -> None:
    from identification.diagnosis.policy import DecisionPolicy

    result = furuta("diagnose", "--policy")
    assert result.exit_code == 0, result.output
    assert result.stdout.strip() == DecisionPolicy().table()
