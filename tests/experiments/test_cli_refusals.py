"""What the commands refuse before any work is done: places that cannot be written, files of another kind."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from experiments.cli.reading import Reading
from furuta_gym.plant import QUBE
from tests.commands import furuta, refused, some_log

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def blocked(tmp_path: Path) -> Path:
    """A folder that cannot be made, because a file has its name."""
    (tmp_path / "taken").write_text("")
    return tmp_path / "taken" / "below"


def test_an_output_that_cannot_be_written_is_told_before_the_work(recorded: Path, blocked: Path, tmp_path: Path):
    plant = QUBE.save(tmp_path / "rig.json")
    for command in (
        ("identify", recorded, "-o", blocked / "rig.json"),
        ("simulate", "--plant", "qube", "-o", blocked / "log.csv"),
        ("validate", plant, recorded, "--plots", blocked),
        ("validate", plant, recorded, "--json", blocked / "gap.json"),
        ("compare", "--plant", "qube", "--controllers", "lqr", "-o", blocked),
        ("diagnose", recorded, "-o", blocked),
        ("trials", "-o", blocked),
        ("train", "--plant", "qube", "-o", blocked / "policy.zip"),
        ("bench", "record", "--rig", "rig-01", "--duration", "1", "-o", blocked / "log.csv"),
    ):
        refused(furuta(*command), "taken", "nothing can be written")


@pytest.mark.filterwarnings("ignore:.*Was the pendulum held")
def test_noise_that_the_plant_file_has_can_be_switched_off(tmp_path: Path):
    from identification.logs.reading import read_log

    plant = QUBE.replace(sensors={"encoder_counts": [0, 0], "noise_std": [1e-2, 1e-2]}).save(tmp_path / "rig.json")
    spread = {}
    for name, options in (("own", ()), ("none", ("--noise", "0"))):
        log = tmp_path / f"{name}.csv"
        done = furuta("simulate", "--plant", plant, "--controller", "none", "--duration", "1", *options, "-o", log)
        assert done.exit_code == 0, done.output
        spread[name] = read_log(log, constant_command="ignore").q1.std()
    assert spread["own"] > 5e-3 > 1e-3 > spread["none"]


def test_a_log_given_for_a_plant_is_told(recorded: Path):
    refused(furuta("validate", recorded, recorded), "is no plant file", "furuta identify")


def test_a_run_of_one_sample_is_no_log(tmp_path: Path):
    to = ("-o", tmp_path / "log.csv")
    refused(furuta("simulate", "--plant", "qube", "--controller", "lqr", "--sample-time", "0.5", *to), "--sample-time")
    refused(furuta("simulate", "--plant", "qube", "--duration", "0.005", *to), "--duration is too short")
    assert not list(tmp_path.iterdir())


def test_columns_and_units_may_be_given_one_by_one(tmp_path: Path):
    """`furuta init` and refusals name one option for each column, and people copy all of them."""
    log = some_log(tmp_path / "log.csv")
    log.write_text(log.read_text().replace("t,q1,q2,u", "s,arm,rod,volts"))
    each = [word for pair in ("t=s", "q1=arm", "q2=rod", "u=volts") for word in ("--columns", pair)]
    reading = (
        *each,
        "--unit",
        "q1=rad",
        "--unit",
        "q2=rad",
        "--input-unit",
        "V",
        "--pendulum-zero",
        "upright",
        "--flip",
        "none",
    )
    done = furuta("init", log, "-o", tmp_path / "rig.toml", *reading)
    assert done.exit_code == 0, done.output
    kept = tomllib.loads((tmp_path / "rig.toml").read_text(encoding="utf-8"))
    assert kept["columns"] == {"t": "s", "q1": "arm", "q2": "rod", "u": "volts"}
    assert (kept["units"]["q1"], kept["units"]["q2"]) == ("rad", "rad")
    said = Reading.of(None, False, None, columns=None, unit=["q1=deg", "q2=counts"]).said
    assert (said.unit_q1, said.unit_q2) == ("deg", "counts")


def test_a_link_that_leads_back_to_itself_is_told(tmp_path: Path):
    (tmp_path / "loop.csv").symlink_to("loop.csv")
    refused(furuta("identify", tmp_path / "loop.csv", "-o", tmp_path / "rig.json"), "leads back to itself")


def test_a_folder_given_for_a_plant_is_told(recorded: Path, tmp_path: Path):
    refused(furuta("validate", tmp_path, recorded), "is a folder", "expected a plant file", "furuta identify")


def test_what_may_be_guessed_of_a_file_without_columns_is_not_offered(tmp_path: Path):
    log = some_log(tmp_path / "log.csv")
    log.write_text("\n".join(row.split(",")[0] for row in log.read_text().splitlines()))
    told = furuta("identify", log, "-o", tmp_path / "rig.json")
    refused(told, "no column q1, q2, u")
    assert "may be read with" not in told.stderr


def test_a_column_that_is_not_there_is_one_problem_with_one_mend(tmp_path: Path) -> None:
    log = some_log(tmp_path / "log.csv")
    log.write_text("\n".join(row.rpartition(",")[0] for row in log.read_text().splitlines()))
    told = furuta("identify", log, "-o", tmp_path / "rig.json")
    refused(told, "no column u. Found: t, q1, q2.", "Name it: --columns u=NAME", "needs a new recording")
    assert "no column is known" not in told.stderr
    assert "things are wrong" not in told.stderr


def test_of_several_logs_the_one_with_the_problem_is_named(tmp_path: Path) -> None:
    good, bad, short = (some_log(tmp_path / f"{name}.csv") for name in ("good", "bad", "short"))
    bad.write_text(bad.read_text().replace("\n", "\nabc", 1))
    some_log(short, n=10)
    for command in (("identify", good, bad, "-o", tmp_path / "rig.json"), ("init", good, bad)):
        told = furuta(*command)
        assert told.exit_code == 2
        assert "Error: bad.csv: " in told.stderr
    both = furuta("identify", good, bad, short, "-o", tmp_path / "rig.json")
    refused(
        both, "Error: good.csv, bad.csv, short.csv: 2 things are wrong", "bad.csv: the text", "short.csv: 10 samples"
    )


def test_one_sample_is_said_in_the_singular(tmp_path: Path) -> None:
    log = some_log(tmp_path / "log.csv", n=1)
    refused(furuta("identify", log, "-o", tmp_path / "rig.json"), "1 sample. Expected at least")


def test_a_warning_is_printed_once(tmp_path: Path):
    log = some_log(tmp_path / "log.csv", q2=np.zeros(400))
    run = [sys.executable, "-c", "from experiments.cli import main; main()", "identify", str(log)]
    told = subprocess.run(
        [*run, "-o", str(tmp_path / "rig.json")], capture_output=True, text=True, timeout=120, cwd=ROOT
    )
    assert told.returncode == 2
    assert told.stderr.count("q2 is 0 rad in every sample") == 1, told.stderr


def test_a_recording_of_the_bench_that_is_stopped_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from experiments.bench import cli as bench

    def stopped(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(bench, "run_experiment", stopped)
    result = furuta("bench", "record", "--rig", "rig-01", "-o", tmp_path / "log.csv")
    assert result.exit_code == 130
    assert "Interrupted. Nothing was written" in result.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("missing", "taken"),
    [
        ("unit", 'taken to be in V. Write "unit": "V" or "unit": "N·m"'),
        ("u_max", 'taken to be 10 V. Write "u_max"'),
    ],
)
def test_what_a_plant_file_leaves_open_is_said(missing: str, taken: str, tmp_path: Path) -> None:
    data = QUBE.to_dict()
    del data[missing]
    (tmp_path / "rig.json").write_text(json.dumps(data))
    result = furuta("simulate", "--plant", tmp_path / "rig.json", "--duration", "0.1", "-o", tmp_path / "log.csv")
    assert result.exit_code == 0, result.output
    assert f'has no "{missing}"' in result.stderr
    assert taken in result.stderr


def test_a_plant_whose_logs_are_null_is_validated(recorded: Path, tmp_path: Path) -> None:
    plant = QUBE.replace(provenance={"logs": None}).save(tmp_path / "rig.json")
    done = furuta("validate", plant, recorded, "--report", tmp_path / "page.html")
    assert done.exit_code == 0, done.output


def test_a_plant_file_without_a_schema_says_which_line_to_write(tmp_path: Path) -> None:
    data = QUBE.to_dict()
    del data["schema"]
    (tmp_path / "rig.json").write_text(json.dumps(data))
    result = furuta("simulate", "--plant", tmp_path / "rig.json", "--duration", "0.1", "-o", tmp_path / "log.csv")
    refused(result, '"schema": "furuta-plant/1"', "write that line")


def test_a_plant_that_is_not_there_says_how_to_make_one(tmp_path: Path) -> None:
    missing = tmp_path / "rig.json"
    refused(
        furuta("simulate", "--plant", missing, "-o", tmp_path / "log.csv"), "no plant", f"identify LOG -o {missing}"
    )


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ("0,0\n0.1,nan\n0.2,1\n", ("column u holds nan at line 3", "mend or delete that row")),
        ("0,0\n0.1,0\n0.1,1\n", ("t goes from 0.1 to 0.1 at line 4", "expected t increasing")),
        ("0,0\n", ("got 1 row", "expected two or more rows")),
    ],
)
def test_a_command_file_that_cannot_be_played_names_the_row(tmp_path: Path, rows: str, words: tuple[str, ...]) -> None:
    (tmp_path / "u.csv").write_text(f"t,u\n{rows}")
    played = tmp_path / "u.csv"
    result = furuta(
        "simulate", "--plant", "qube", "--excitation", played, "--duration", "1", "-o", tmp_path / "log.csv"
    )
    refused(result, "u.csv", *words)
    assert not (tmp_path / "log.csv").exists()


ODD: dict[str, tuple[str, tuple[str, ...]]] = {
    "a parameter that no fit has": (
        "identify LOG -o r.json --fix theta11=3",
        ("--fix or --prior theta11", "theta9, r"),
    ),
    "a prior on none": ("identify LOG -o r.json --prior theta0=1±0.1", ("theta0: expected one of theta1",)),
    "a parameter of an effect that is not fitted": (
        "identify LOG -o r.json --fix arm_spring.k=1",
        ("arm_spring.k", "NAME.PARAMETER of the effects in --effects"),
    ),
    "a method": ("identify LOG -o r.json --method foo", ("--method 'foo': expected one of prediction-error",)),
    "a largest command": ("identify LOG -o r.json --u-max -1", ("--u-max -1: expected the largest command", "above 0")),
    "a value of an effect": (
        "identify LOG -o r.json --effects arm_spring:k=0.3",
        ("names alone", "--fix arm_spring.k"),
    ),
    "an effect to fit": ("identify LOG -o r.json --effects arm_sprng", ("did you mean arm_spring? `furuta effects`",)),
    "an effect twice": ("identify LOG -o r.json --effects base_tilt,base_tilt", ("stands there twice",)),
    "an effect to simulate": ("simulate --plant qube --effect foo -o s.csv", ("'foo'. `furuta effects` lists",)),
    "an effect in detail": ("effects foo", ("`furuta effects` lists the library",)),
    "an effect to separate": ("excite --plant qube --between input_delay,foo -o d.csv", ("--between foo: no such",)),
    "one effect to separate": ("excite --plant qube --between base_tilt -o d.csv", ("two effects or more, such as",)),
    "an effect of trials": ("trials --effects foo -o t", ("unknown effects: foo. `furuta effects` lists the library",)),
    "no seeds": ("trials --seeds 0 -o t", ("--seeds 0: expected 1 to 1000",)),
    "a horizon": ("validate qube LOG --horizon -1", ("--horizon -1: expected seconds, above 0 and at most 5",)),
    "plant and log swapped": ("validate LOG rig.json", ("validate PLANT LOG…",)),
    "a current": ("validate qube LOG --input-unit A", ("--input-unit 'A': expected V or N·m", "--input-scale")),
    "a unit": ("validate qube LOG --unit grad", ("--unit q1='grad': expected rad, deg, turns or counts",)),
    "an axis": ("validate qube LOG --flip q9", ("--flip 'q9': expected q1, q2 or u",)),
    "columns": ("validate qube LOG --columns foo", ("--columns 'foo': expected pairs such as t=Time",)),
    "counts": ("validate qube LOG --encoder-counts ten", ("--encoder-counts 'ten': expected numbers, separated by",)),
    "a zero": ("validate qube LOG --pendulum-zero down", ("--pendulum-zero 'down': expected upright or hanging",)),
    "a clock": ("validate qube LOG --time-unit h", ("--time-unit 'h': expected one of s, ms",)),
    "a scale": ("validate qube LOG --input-scale -2", ("--input-scale -2.0: expected a positive", "(use --flip for")),
    "a start": ("validate qube LOG --skip -1", ("Error: --skip -1.0: expected seconds, not negative\n",)),
    "a column of none": ("validate qube LOG --columns x=y", ("--columns 'x' on the left: expected one of t, q1",)),
    "a group of trials": (
        "compare --plant qube --groups wind -o c",
        ("--groups 'wind': expected of balance", "or all"),
    ),
    "no group": ("compare --plant qube --groups= -o c", ("--groups '': expected of balance",)),
    "no policy": ("export qube -o a.onnx", ("furuta export qube policy.zip -o a.onnx",)),
}
"""A command line, and what its refusal says: the option as it was typed, and what was expected."""


@pytest.mark.parametrize(("line", "words"), ODD.values(), ids=ODD)
def test_a_refusal_names_the_option_and_what_to_write(
    line: str, words: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    log = some_log(tmp_path / "log.csv")
    QUBE.save(tmp_path / "rig.json")
    told = furuta(*(str(log) if word == "LOG" else word for word in line.split()))
    refused(told, *words)
    assert len(told.stderr) < 300, "the whole library is no help"
    assert told.stderr.startswith("Error: "), "before any work"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["log.csv", "rig.json"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--groups", "swing_up"), ("nothing to compare", "lqr cannot swing up")),
        (("--groups", "balance", "--duration", "0.0001"), ("--duration 0.0001 s", "one sample")),
        (("--sample-time", "0"), ("--sample-time 0.0", "seconds")),
    ],
)
def test_a_comparison_of_nothing_is_refused(arguments: tuple[str, ...], words: tuple[str, ...], tmp_path: Path):
    given = ("compare", "--plant", "qube", "--controllers", "lqr", "--trials", "2", *arguments)
    result = furuta(*given, "-o", tmp_path / "out")
    assert result.exit_code == 2
    for word in words:
        assert word in result.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--curriculum", "2", "--randomize"), ("--curriculum 2", "share of successes")),
        (("--noise", "nan"), ("--noise nan", "rad")),
        (("--arm-margin", "nan"), ("--arm-margin nan", "rad")),
        (("--sample-time", "0"), ("--sample-time 0.0", "seconds")),
    ],
)
def test_a_training_names_the_option_that_cannot_be(arguments: tuple[str, ...], words: tuple[str, ...], tmp_path: Path):
    refused(furuta("train", "--plant", "qube", *arguments, "-o", tmp_path / "policy.zip"), *words)


def test_an_amplitude_that_is_no_number_is_not_the_files_fault(tmp_path: Path):
    (tmp_path / "u.csv").write_text("t,d\n0,1\n1,0\n")
    given = ("simulate", "--plant", "qube", "--excitation", tmp_path / "u.csv", "--amplitude", "nan")
    refused(furuta(*given, "-o", tmp_path / "log.csv"), "--amplitude nan")
    assert not (tmp_path / "log.csv").exists()


def test_a_link_to_itself_is_told_by_name(tmp_path: Path):
    """As a file of an export, and as a folder."""
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    result = furuta("export", "qube", "--controller", "lqr", "-o", tmp_path / "loop" / "x.h")
    assert result.exit_code == 2
    assert "loop/x.h" in result.stderr
    assert ".new" not in result.stderr, "no name of a temporary file"
    result = furuta("compare", "--plant", "qube", "--controllers", "lqr", "--trials", "2", "-o", tmp_path / "loop")
    assert result.exit_code == 2, result.output
    assert "loop" in result.stderr


def test_what_is_recommended_is_what_was_compared(tmp_path: Path):
    """The gains of the plant that was designed for, at the period that was played."""
    other = QUBE.replace(sample_time=0.01).save(tmp_path / "other.json")
    given = ("--controllers", "lqr", "--trials", "2", "--groups", "balance", "--duration", "1")
    result = furuta("compare", "--plant", "qube", "--design-plant", other, *given, "-o", tmp_path / "a")
    assert f"Next: furuta export {other} --controller lqr --sample-time 0.004 -o" in result.stdout
    result = furuta("compare", "--plant", "qube", "--sample-time", "0.01", *given, "-o", tmp_path / "b")
    assert "Next: furuta export qube --controller lqr --sample-time 0.01 -o" in result.stdout
