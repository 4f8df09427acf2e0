"""Options of `furuta identify` that are about uncertainty and limits: --profile, --u-max."""

from __future__ import annotations

import errno
import json
import re
from dataclasses import replace
from html import unescape
from pathlib import Path

import pytest
from typer.testing import CliRunner

from experiments.cli.app import app
from experiments.cli.identify import _check_known, _check_profiles
from experiments.cli.reading import Reading
from experiments.replaced import limits_lost
from furuta_gym.plant import QUBE, TABLE_3, Effect, Plant
from identification.estimation.estimate import Estimate
from identification.logs.log import write_log
from identification.logs.rig_file import save_mapping
from identification.logs.rig_mapping import RigMapping
from tests.factories import loop_log


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("logs") / "log.csv"
    write_log(path, loop_log(duration=5.0, T=0.004)[0])
    return path


def run(*arguments: object):
    return CliRunner().invoke(app, ["identify", *map(str, arguments)])


def test_a_profile_interval_stands_beside_the_standard_deviation(file: Path, tmp_path: Path) -> None:
    output = tmp_path / "rig.json"
    result = run(file, "-o", output, "--profile", "theta2", "--u-max", 12, "--json")
    assert result.exit_code == 0, result.output
    answer = json.loads(result.stdout)
    low, high = answer["profiles"]["theta2"]["interval"]
    found = answer["parameters"]["theta2"]
    assert low < found["value"] < high
    # close to quadratic here, so the two kinds of interval must agree about their width
    assert (high - low) / (2 * 1.96 * found["std"]) == pytest.approx(1.0, abs=0.4)
    assert Plant.load(output).u_max == 12.0
    assert Plant.load(output).provenance["u_max"] == "given"


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["--profile", "theta12"], "theta12"),
        (["--profile", "theta2", "--fix", "theta2=0.04"], "theta2"),
        (["--profile", "theta2", "--method", "filtered-ls"], "--profile"),
        (["--effects", "arm_sprung"], "did you mean arm_spring?"),
        (["--effects", "arm_spring,arm_spring"], "twice"),
        (["--effects", "arm_spring", "--method", "filtered-ls"], "--effects"),
        (["--u-max", "0.1"], "--u-max"),
        (["--u-max", "nan"], "--u-max"),
    ],
)
def test_what_cannot_be_is_refused_before_the_fit(file: Path, tmp_path: Path, arguments: list[str], word: str) -> None:
    result = run(file, "-o", tmp_path / "rig.json", *arguments)
    assert result.exit_code == 2
    assert word in result.stderr
    assert not list(tmp_path.iterdir())


def test_effects_that_are_named_are_fitted_too(file: Path, tmp_path: Path) -> None:
    output = tmp_path / "rig.json"
    result = run(file, "-o", output, "--effects", "arm_spring")
    assert result.exit_code == 0, result.output
    (spring,) = Plant.load(output).effects
    assert spring.name == "arm_spring"
    assert abs(spring.parameters["k"]) < 0.05  # the rig has none
    assert "arm_spring.k" in result.stdout


def test_a_report_of_the_fit_and_of_its_validation(file: Path, tmp_path: Path) -> None:
    rig, page, other = tmp_path / "rig.json", tmp_path / "page.html", tmp_path / "validation.html"
    result = run(file, "-o", rig, "--report", page)
    assert result.exit_code == 0, result.output
    assert f"Written: {rig}, {page}" in result.stdout
    html = page.read_text(encoding="utf-8")
    theta1 = next(line.split()[1:4] for line in result.stdout.splitlines() if line.startswith("  theta1"))
    assert "\u00a0".join(theta1) in html
    assert "The test is a log that was not." in html
    result = CliRunner().invoke(app, ["validate", str(rig), str(file), "--report", str(other)])
    assert result.exit_code == 0, result.output
    ratio = result.stdout.split(" times the noise floor")[0].split()[-1]
    assert f"its error is {ratio} times the noise floor" in other.read_text(encoding="utf-8")
    assert "log.csv: the plant was fitted to it" in other.read_text(encoding="utf-8")


@pytest.mark.parametrize("name", ["page.txt", "log.csv", "no.html/page"])
def test_a_report_that_cannot_be_written_is_refused_before_the_fit(file: Path, tmp_path: Path, name: str) -> None:
    result = run(file, "-o", tmp_path / "rig.json", "--report", tmp_path / name)
    assert result.exit_code == 2
    assert ".html" in result.stderr
    assert not list(tmp_path.iterdir())


def test_adequacy_comes_before_the_parameters(file: Path, tmp_path: Path) -> None:
    """The error on the fitted logs is the first thing said of a fit; a wrong model is not called identified alone."""
    picture = tmp_path / "fit.png"
    good = run(file, "-o", tmp_path / "rig.json", "--plot", picture)
    assert good.exit_code == 0, good.output
    assert picture.read_bytes().startswith(b"\x89PNG")
    said = good.stdout
    assert re.search(r"u_max = [\d.]+ V \(largest command [\d.]+, plus margin\); set it with --u-max", said)
    assert "Next: furuta validate" in said
    assert said.index("nothing of size is missing") < said.index("Estimate (")
    hidden = tmp_path / "cable.csv"
    write_log(hidden, loop_log("arm_spring", duration=5.0, T=0.004)[0])
    bad = run(hidden, "-o", tmp_path / "bad.json", "--json")
    gap = json.loads(bad.stdout)["gap"]
    assert gap["ratio_to_floor"] > 10.0
    assert gap["adequacy"] == "not adequate"
    said = run(hidden, "-o", tmp_path / "bad.json").stdout
    assert "nothing of size is missing" not in said
    assert "times the noise floor: the plant misses something" in said
    assert said.index("counts, floor") < said.index("furuta diagnose") < said.index("parameters identified")


def test_a_log_that_can_be_fitted_and_not_predicted_is_fitted(tmp_path: Path) -> None:
    """A second is enough for a fit; a prediction needs a little more."""
    short, rig = tmp_path / "short.csv", tmp_path / "short.json"
    write_log(short, loop_log(duration=1.05, T=0.004)[0])
    told = run(short, "-o", rig)
    assert told.exit_code == 0, told.output
    assert "Not predicted: no log is long enough" in told.stdout
    assert Plant.load(rig).theta[0] == pytest.approx(TABLE_3.theta[0], rel=0.1)


def test_the_time_to_expect_is_that_of_the_samples_that_are_fitted() -> None:
    from experiments.cli.identify import _fitted
    from identification.estimation.informative import BUDGET
    from identification.estimation.methods import DEFAULT

    assert _fitted(3_600_000, DEFAULT, False) == BUDGET
    assert _fitted(3_600_000, DEFAULT, True) == _fitted(3_600_000, "least-squares", False) == 3_600_000
    assert _fitted(1000, DEFAULT, False) == 1000


def test_ctrl_c_in_a_profile_leaves_nothing_new(file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def stopped(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("identification.estimation.estimate.Estimate.profile", stopped)
    result = run(file, "-o", tmp_path / "rig.json", "--profile", "theta2")
    assert result.exit_code == 130
    assert "Nothing was written" in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_does_not_cost_the_numbers(file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Estimate, "save", full)
    result = run(file, "-o", tmp_path / "rig.json")
    assert result.exit_code != 0
    assert "theta5" in result.stdout
    assert "Written" not in result.stdout


def test_limits_of_the_rig_that_a_new_file_would_lose_are_said(tmp_path: Path) -> None:
    limited = QUBE.replace(limits={"supply": 5.0, "arm_travel": 2.0})
    rig = limited.save(tmp_path / "rig.json")
    told = limits_lost(rig, QUBE)
    assert "supply 5, arm_travel 2" in told
    assert limits_lost(rig, limited) == ""
    assert limits_lost(tmp_path / "new.json", QUBE) == ""
    (tmp_path / "no_plant.json").write_text("{}")
    assert limits_lost(tmp_path / "no_plant.json", QUBE) == ""


def test_an_inertia_that_cannot_be_is_refused_before_the_log_is_read(tmp_path: Path) -> None:
    result = run(tmp_path / "missing.csv", "-o", tmp_path / "rig.json", "--fix", "theta1=-1")
    assert result.exit_code == 2
    assert "--fix theta1=-1" in result.stderr
    assert "inertia" in result.stderr


def test_ctrl_c_while_the_picture_is_drawn_leaves_nothing_new(
    file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stopped(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("identification.validation.plots.plot_predictions", stopped)
    result = run(file, "-o", tmp_path / "rig.json", "--plot", tmp_path / "fit.png")
    assert result.exit_code == 130
    assert "Nothing was written" in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_the_next_command_reads_the_log_as_this_one_did(tmp_path: Path) -> None:
    """In its folder, with its options, on the page as well."""
    (tmp_path / "my data").mkdir()
    log, rig, page = tmp_path / "my data" / "log.csv", tmp_path / "rig.json", tmp_path / "page.html"
    write_log(log, loop_log("arm_spring", duration=5.0, T=0.004)[0])
    result = run(log, "--skip", 0.5, "--input-scale", 0.5, "--mapping", "none", "-o", rig, "--report", page)
    assert result.exit_code == 0, result.output
    options = "--input-scale 0.5 --skip 0.5 --mapping none"
    assert f"Next: furuta diagnose '{log}' {options} --held-out LOG -o diagnosis   (" in result.stdout
    assert f"furuta diagnose '{log}' {options} -o diagnosis" in unescape(page.read_text(encoding="utf-8"))


def test_what_a_rig_toml_says_need_not_be_typed_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    mapping = RigMapping(skip=0.5)
    log = replace(loop_log(duration=5.0, T=0.004)[0], mapping=mapping)
    assert Reading(RigMapping()).again([Path("log.csv")], [log]) == " --skip 0.5"
    save_mapping(tmp_path / "rig.toml", mapping)
    assert Reading(RigMapping()).again([Path("log.csv")], [log]) == ""
    later = replace(log, mapping=RigMapping(skip=1.0))
    assert Reading(RigMapping(skip=1.0), as_given=True).again([Path("log.csv")], [later]) == " --skip 1 --as-given"
    assert Reading(RigMapping(), Path("my rig.toml")).again([Path("log.csv")], [log]) == " --mapping 'my rig.toml'"


def test_every_free_parameter_may_be_profiled() -> None:
    _check_profiles(["arm_spring.k", "r"], [], [], ["arm_spring"], None)
    apart = QUBE.replace(friction_sharpness=(80.0, 300.0)).with_effects(QUBE.default_effect("input_delay"))
    _check_profiles(["r2", "input_delay.d"], ["r1"], [], [], apart)
    _check_profiles(["r2"], [], ["r1"], [], None)  # a value of one gives each its own
    for names, fixed, start in (
        (["arm_spring.k"], [], None),
        (["arm_spring.k"], ["arm_spring.k"], QUBE.with_effects(QUBE.default_effect("arm_spring"))),
        (["r"], [], apart),
        (["r1"], ["r"], apart),
        (["r1"], [], None),
    ):
        with pytest.raises(ValueError, match="expected a free parameter"):
            _check_profiles(names, fixed, [], [], start)


def test_the_sharpness_of_each_joint_may_be_given() -> None:
    _check_known(["r1", "r2", "r", "arm_spring.k"], ["arm_spring"], QUBE)
    with pytest.raises(ValueError, match="r3: expected one of"):
        _check_known(["r3"], [], None)


@pytest.mark.parametrize(
    "arguments",
    [
        ["--effects", "arm_spring", "--profile", "arm_spring.k"],
        ["--fix", "r1=90", "--profile", "r2"],
        ["--prior", "r1=90±9", "--profile", "r1"],
        ["--start", "PLANT", "--profile", "r2,arm_spring.k", "--fix", "r1=90"],
    ],
)
def test_every_free_parameter_can_be_profiled(file: Path, tmp_path: Path, arguments: list[str]) -> None:
    """What is refused here is the limit of the command, which is looked at after the names."""
    apart = QUBE.replace(friction_sharpness=(80.0, 120.0)).with_effects(Effect("arm_spring", {"k": 0.1}))
    plant = apart.save(tmp_path / "start.json")
    given = [str(plant) if a == "PLANT" else a for a in arguments]
    result = run(file, "-o", tmp_path / "rig.json", *given, "--u-max", "0.001")
    assert result.exit_code == 2
    assert "--u-max" in result.stderr
    assert "--profile" not in result.stderr


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--effects", "arm_spring", "--profile", "arm_spring.x"], "arm_spring.k"),
        (["--fix", "r=90", "--profile", "r"], "expected a free parameter"),
        (["--fix", "r1=90", "--profile", "r"], "r2"),
        (["--effects", "arm_spring", "--fix", "arm_spring.k=0", "--profile", "arm_spring.k"], "arm_spring.q1n"),
    ],
)
def test_what_is_not_free_cannot_be_profiled(file: Path, tmp_path: Path, arguments: list[str], words: str) -> None:
    result = run(file, "-o", tmp_path / "rig.json", *arguments)
    assert result.exit_code == 2
    assert "--profile" in result.stderr
    assert words in result.stderr
