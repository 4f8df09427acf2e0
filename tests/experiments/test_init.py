"""`furuta init` and what every command makes of it: a stranger's log is read without a word, a wrong one says why."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from experiments.cli import app
from furuta_gym.plant import QUBE
from furuta_gym.sensors import Sensors
from furuta_gym.simulation import open_loop, simulate
from identification import read_log
from identification.design.signals import Chirp
from identification.logs.checks import LogError
from identification.logs.rig_file import load_mapping, save_mapping
from identification.logs.rig_mapping import RigMapping
from tests.commands import furuta, refused
from tests.factories import paper_log

DATA = Path(__file__).parent.parent / "data"


def test_the_german_log_is_read_without_a_question(german: Path) -> None:
    result = furuta("init", "versuch1.csv")
    assert result.exit_code == 0, result.output
    assert "Next: furuta identify versuch1.csv -o rig.json" in result.stdout
    found = load_mapping("rig.toml")
    assert found == RigMapping(
        t="Zeit [ms]",
        q1="Arm [°]",
        q2="Pendel [°]",
        u="Spannung [V]",
        time_unit="ms",
        unit_q1="deg",
        unit_q2="deg",
        pendulum_zero="hanging",
        flip=("q2",),
        encoder_counts=(2048.0, 2048.0),
        input_unit="V",
    )
    text = Path("rig.toml").read_text(encoding="utf-8")
    assert "# the pendulum falls towards 0" in text
    assert "not in UTF-8; read as Windows-1252" in result.stdout
    log = read_log("versuch1.csv", **found.arguments())
    assert abs(abs(log.q2[0]) - np.pi) < 0.01  # it hangs at first


def test_the_log_is_what_the_bench_recorded(german: Path) -> None:
    from experiments.bench import record
    from tests.data.make_logs import DURATION, RIG, RUNS

    furuta("init", "versuch1.csv", "versuch2.csv")
    for name, (experiment, seed) in RUNS.items():
        log, run = read_log(name, **load_mapping("rig.toml").arguments()), record(RIG, experiment, seed, DURATION)
        assert np.allclose(log.q1, run.q1, atol=1e-5)
        assert np.allclose(np.sin(log.q2), np.sin(run.q2), atol=1e-5)
        assert np.allclose(log.u, run.u, atol=1e-4)


def test_every_command_takes_it_and_says_so(german: Path) -> None:
    furuta("init", "versuch1.csv")
    for arguments in (
        ["validate", "qube", "versuch2.csv"],
        ["validate", "qube", "versuch2.csv", "--mapping", "rig.toml"],
    ):
        result = furuta(*arguments)
        assert result.exit_code == 0, result.output
        assert "Read as rig.toml says: --columns" in result.stderr
        assert "times the noise floor" in result.stdout


def test_every_command_that_reads_logs_takes_a_mapping() -> None:
    commands = typer.main.get_command(app).commands  # type: ignore[attr-defined]
    takes = {name: {p.name for p in command.params} for name, command in commands.items()}
    reading = {name for name, params in takes.items() if "logs" in params and name not in ("init", "studio")}
    assert reading == {"identify", "validate", "diagnose", "residuals", "score"}
    assert all({"mapping", "columns", "as_given"} <= takes[name] for name in reading)


def test_init_starts_from_a_mapping_that_is_given(tmp_path: Path) -> None:
    table = {"t": rows()["t"], "arm": rows()["q1"], "pend": rows()["q2"], "volt": rows()["u"]}
    log = write(tmp_path / "log.csv", table, "# input_unit: V")
    said = tmp_path / "said.toml"
    save_mapping(said, RigMapping(q1="arm", q2="pend", u="volt", encoder_counts=(2048.0, 2048.0)))
    result = furuta("init", log, "--mapping", said, "--yes", "--json")
    assert result.exit_code == 0, result.output
    assert load_mapping(tmp_path / "rig.toml").encoder_counts == (2048.0, 2048.0)
    refused(furuta("init", log, "--mapping", tmp_path / "none.toml", "--yes"), "none.toml")


def test_a_free_decay_is_validated_with_a_warning(tmp_path: Path) -> None:
    run = simulate(QUBE, open_loop(), 4.0, 0.004, Sensors(2048), x0=(0, 2.5, 0, 0))
    table = {"t": run.t.round(6), "q1": run.measured[:, 0], "q2": run.measured[:, 1], "u": 0.0 * run.command}
    still = furuta("validate", "qube", write(tmp_path / "still.csv", table, "# input_unit: V"))
    assert still.exit_code == 0, still.output
    assert "the command is 0 in every sample of still.csv" in still.stderr
    assert "--columns u=NAME" in still.stderr
    driven = furuta("validate", "qube", write(tmp_path / "driven.csv", rows(), "# input_unit: V"))
    assert "in every sample" not in driven.stderr


def test_without_a_mapping_the_whole_of_it_is_proposed(german: Path) -> None:
    result = furuta("identify", "versuch1.csv", "-o", "rig.json")
    refused(result, "--columns 't=Zeit [ms],q1=Arm [°],q2=Pendel [°],u=Spannung [V]'", "--time-unit ms", "--unit deg")
    refused(result, "--pendulum-zero hanging --flip q2", "furuta init versuch1.csv")
    assert not Path("rig.json").exists()


def test_json_has_every_item(german: Path) -> None:
    import json

    result = furuta("init", "versuch1.csv", "--json")
    found = json.loads(result.stdout)
    assert found["mapping"]["pendulum_zero"] == "hanging"
    assert {item["confidence"] for item in found["items"]} == {"sure"}
    assert all(item["reason"] for item in found["items"])


# --- what is not sure --------------------------------------------------------------------------------------


def rows(**changes: np.ndarray) -> dict[str, np.ndarray]:
    """A QUBE that hangs and is driven, by our names; changes replace columns or add some."""
    chirp = Chirp(2.0, 0.5, 3.0, 8.0)
    run = simulate(QUBE, open_loop(), 8.0, 0.004, Sensors(2048), excitation=chirp, x0=(0, np.pi, 0, 0))
    own = {"t": run.t.round(6), "q1": run.measured[:, 0], "q2": run.measured[:, 1], "u": run.command}
    return own | changes


def write(
    path: Path, columns: Mapping[str, np.ndarray], head: str = "", names: Mapping[str, str] | None = None
) -> Path:
    header = ",".join((names or {}).get(c, c) for c in columns)
    lines = [",".join(map(repr, row)) for row in zip(*(np.asarray(c).tolist() for c in columns.values()), strict=True)]
    path.write_text("\n".join([*head.splitlines(), header, *lines, ""]), encoding="utf-8")
    return path


def test_without_a_terminal_it_says_what_to_give(tmp_path: Path) -> None:
    log = write(tmp_path / "log.csv", rows())
    result = furuta("init", log)
    assert result.exit_code == 2
    assert "--input-unit V" in result.stderr
    assert "--yes" in result.stderr
    assert "Nothing was written" in result.stderr
    assert not (tmp_path / "rig.toml").exists()
    assert furuta("init", log, "--input-unit", "V").exit_code == 0
    assert furuta("init", log, "--yes").exit_code == 0


def test_the_advised_command_says_what_was_said_already(tmp_path: Path) -> None:
    log, rig = write(tmp_path / "log.csv", rows()), tmp_path / "my rig.toml"
    result = furuta("init", log, "--pendulum-zero", "upright", "--skip", 1, "-o", rig)
    assert result.exit_code == 2
    assert f"furuta init {log} --pendulum-zero upright --skip 1 -o '{rig}' --yes\n" in result.stderr
    said = furuta("init", log, "--input-unit", "V", "-o", rig).stdout
    assert f"Next: furuta identify {log} --mapping '{rig}' -o rig.json" in said


def test_a_sign_that_the_log_does_not_show_comes_with_the_try_by_hand(tmp_path: Path) -> None:
    """The bundled upright log whose first ten seconds do not show the command's sign."""
    bundled = Path(__file__).resolve().parents[2] / "experiments" / "demo" / "logs" / "paper.csv"
    head = bundled.read_text(encoding="utf-8").splitlines()[:5000]
    (tmp_path / "log.csv").write_text("\n".join(head) + "\n", encoding="utf-8")
    result = furuta("init", tmp_path / "log.csv")
    assert result.exit_code == 2
    assert "--flip u, or --flip none" in result.stderr
    assert "none if a small positive command makes q1 rise" in result.stderr


def test_the_next_command_holds_out_only_what_was_not_fitted(tmp_path: Path) -> None:
    """A diagnosis refuses a log that is searched and held out at once, so `validate` does not propose it."""
    one = write(tmp_path / "one.csv", rows(), "# input_unit: V")
    other = write(tmp_path / "other.csv", rows(u=1.2 * rows()["u"]), "# input_unit: V")
    hashed = [{"source": "one.csv", "sha256": read_log(one).sha256}]
    plant = QUBE.replace(theta=QUBE.theta * 1.5, provenance={"logs": hashed}).save(tmp_path / "rig.json")
    said = furuta("validate", plant, one, other).stdout
    assert f"Next: furuta diagnose {one} --held-out {other} -o diagnosis" in said
    said = furuta("validate", plant, one).stdout
    assert f"Next: furuta diagnose {one} --held-out LOG -o diagnosis   (LOG: not fitted" in said


def test_yes_does_not_take_what_nobody_knows(tmp_path: Path) -> None:
    table = rows()
    whole = {q: np.round(table[q] * 2048 / (2 * np.pi)).astype(int) for q in ("q1", "q2")}
    log = write(tmp_path / "log.csv", table | whole)
    result = furuta("init", log, "--yes")
    assert result.exit_code == 2
    assert "--encoder-counts COUNTS" in result.stderr
    assert "The motion may tell the rest then: pendulum's zero." in result.stderr
    assert "--pendulum-zero" not in result.stderr
    assert furuta("init", log, "--yes", "--encoder-counts", "2048").exit_code == 0
    assert load_mapping(tmp_path / "rig.toml").unit_q2 == "counts"


def test_on_a_terminal_it_asks_only_for_that(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = write(tmp_path / "log.csv", rows())
    monkeypatch.setattr("experiments.cli.init._talks", lambda: True)
    result = CliRunner().invoke(app, ["init", str(log)], input="N·m\n")
    assert result.exit_code == 0, result.output
    assert result.stderr.count("command in") == 2  # the reason and the question
    assert load_mapping(tmp_path / "rig.toml").input_unit == "N·m"
    wrong = CliRunner().invoke(app, ["init", str(log), "--out", str(tmp_path / "b.toml")], input="apples\nV\n")
    assert wrong.exit_code == 0, wrong.output
    assert "apples" in wrong.stderr


def test_leaving_at_a_question_writes_nothing_and_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = write(tmp_path / "log.csv", rows())
    monkeypatch.setattr("experiments.cli.init._talks", lambda: True)
    result = CliRunner().invoke(app, ["init", str(log)], input="")
    assert result.exit_code == 130
    assert "Interrupted. Nothing was written" in result.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["log.csv"]


def test_one_thing_that_is_not_sure_is_said_in_the_singular(tmp_path: Path) -> None:
    result = furuta("init", write(tmp_path / "log.csv", rows()))
    assert result.exit_code == 2
    assert "things is not sure. Give it as an option:" in result.stderr


def test_another_answer_replaces_nothing_without_a_word(tmp_path: Path) -> None:
    log = write(tmp_path / "log.csv", rows())
    furuta("init", log, "--input-unit", "V")
    before = (tmp_path / "rig.toml").read_bytes()
    refused_before = furuta("init", log, "--input-unit", "N·m")
    assert refused_before.exit_code == 2
    assert "--yes" in refused_before.stderr
    assert (tmp_path / "rig.toml").read_bytes() == before
    assert furuta("init", log, "--input-unit", "V").exit_code == 0
    assert furuta("init", log, "--input-unit", "N·m", "--yes").exit_code == 0
    assert load_mapping(tmp_path / "rig.toml").input_unit == "N·m"


# --- twelve wrong files ------------------------------------------------------------------------------------

NAMED = {"t": "Time [s]", "q1": "Arm [rad]", "q2": "Pendulum [rad]", "u": "Voltage [V]"}
DEGREES = 180 / np.pi


def two_in_one() -> dict[str, np.ndarray]:
    return {name: np.concatenate([values, values]) for name, values in rows().items()}


def other_rig() -> dict[str, np.ndarray]:
    log = paper_log(0.004, 8.0, 4096)[0]  # Table 3
    return {"t": log.t, "q1": log.q1, "q2": log.q2, "u": log.u}


def holed() -> dict[str, np.ndarray]:
    table = rows()
    table["q2"] = table["q2"].copy()
    table["q2"][100] = np.nan
    return table


WRONG: dict[str, tuple[Callable[[], Mapping[str, np.ndarray]], str, tuple[str, ...]]] = {
    "degrees called radians": (
        lambda: rows(q1=DEGREES * rows()["q1"], q2=DEGREES * rows()["q2"]),
        "",
        ("Arm [rad] is stated in rad, but looks like deg", "--unit q1=deg", "--unit q2=deg"),
    ),
    "milliseconds called seconds": (lambda: rows(t=1e3 * rows()["t"]), "", ("Time [s]", "--time-unit ms")),
    "days called seconds": (lambda: rows(t=45_000 + rows()["t"] / 86400), "", ("Time [s]", "--time-unit d")),
    "a zero that the file states wrongly": (
        rows,
        "# pendulum_zero: hanging\n",
        ("the file says", "falls as if it were upright", "--pendulum-zero upright"),
    ),
    "a zero that is neither": (lambda: rows(q2=rows()["q2"] - np.pi / 2), "", ("neither upright nor hanging",)),
    "angles swapped": (
        lambda: rows(q1=rows()["q2"], q2=rows()["q1"]),
        "",
        ("swapped", "--columns 'q1=Pendulum [rad],q2=Arm [rad]'"),
    ),
    "arm and command swapped": (lambda: rows(q1=rows()["u"], u=rows()["q1"]), "", ("swapped",)),
    "a constant command": (
        lambda: rows(u=np.full(2000, 1.5)),
        "",
        ("command u is 1.5 in every sample", "--columns u="),
    ),
    "two recordings in one file": (two_in_one, "", ("time runs backwards", "split the file")),
    "an empty cell": (holed, "", ("NaN (or an empty cell) in column Pendulum [rad]", "line")),
    "too short": (lambda: {name: values[:30] for name, values in rows().items()}, "", ("30 samples",)),
    "no command": (lambda: {k: v for k, v in rows().items() if k != "u"}, "", ("command (u)", "--columns u=NAME")),
}


@pytest.mark.parametrize(("make", "head", "words"), WRONG.values(), ids=WRONG)
def test_a_wrong_file_says_what_is_wrong_and_nothing_is_written(
    tmp_path: Path, make: Callable[[], Mapping[str, np.ndarray]], head: str, words: tuple[str, ...]
) -> None:
    log = write(tmp_path / "log.csv", make(), head, NAMED)
    result = furuta("init", log, "--yes")
    assert result.exit_code == 2, result.output
    for word in words:
        assert word in result.stderr
    assert "Nothing was written" in result.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["log.csv"]
    mapping = ["--columns", ",".join(f"{ours}={NAMED[ours]}" for ours in make())]
    refused(furuta("identify", log, *mapping, "-o", tmp_path / "rig.json"))
    assert [path.name for path in tmp_path.iterdir()] == ["log.csv"]


def test_two_rigs_mixed(tmp_path: Path) -> None:
    one, other = write(tmp_path / "one.csv", rows()), write(tmp_path / "other.csv", other_rig())
    result = furuta("init", one, other, "--yes")
    assert result.exit_code == 2
    assert "not of one rig" in result.stderr
    assert not (tmp_path / "rig.toml").exists()
    refused(furuta("identify", one, other, "-o", tmp_path / "rig.json"), "not of one rig")


def test_a_wrong_sign_refuses_the_fit_unless_it_is_meant(tmp_path: Path) -> None:
    log = write(tmp_path / "log.csv", rows(q2=-rows()["q2"]))
    result = furuta("validate", "qube", log)
    refused(result, "do not move as those of one rig", "--flip q2", "--as-given")
    assert furuta("validate", "qube", log, "--as-given").exit_code == 0


def test_hanging_read_without_the_flip_makes_no_plant(german: Path) -> None:
    """The mapping but for the sign of q2: a fit of it would look like a result."""
    furuta("init", "versuch1.csv")
    mapping = load_mapping("rig.toml")
    save_mapping("rig.toml", replace(mapping, flip=()), {}, "without the flip")
    result = furuta("identify", "versuch1.csv", "-o", "rig.json", "--method", "filtered-ls")
    refused(result, "do not move as those of one rig", "--pendulum-zero hanging --flip q2", "--as-given")
    assert sorted(path.name for path in german.iterdir()) == ["rig.toml", "versuch1.csv", "versuch2.csv"]


def test_all_that_is_wrong_is_one_message(tmp_path: Path) -> None:
    table = rows(t=1e3 * rows()["t"], q1=DEGREES * rows()["q1"], q2=DEGREES * (rows()["q2"] - np.pi))
    result = furuta("identify", write(tmp_path / "log.csv", table), "-o", tmp_path / "rig.json")
    refused(result, "4 things are wrong", "--time-unit ms", "--unit q1=deg", "--unit q2=deg", "--pendulum-zero hanging")


# --- rig.toml ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("schema = 'furuta-rig/1'\n[colums]\nt = 'x'", "colums"),
        ("schema = 'furuta-rig/1'\n[columns]\nq3 = 'x'", "q3"),
        ("schema = 'furuta-rig/1'\n[columns]\nt = 3", "name of a column"),
        ("schema = 'furuta-rig/1'\n[units]\ntime = 'weeks'", "weeks"),
        ("schema = 'furuta-rig/1'\n[signs]\nflip = ['q7']", "q7"),
        ("[columns]\nt = 'x'", "furuta-rig/1"),
        ("schema = ", "not a TOML file"),
        ("a = " + "[" * 5000, "rig.toml"),
    ],
)
def test_a_broken_rig_file_is_refused_by_name(tmp_path: Path, text: str, word: str) -> None:
    (tmp_path / "rig.toml").write_text(text)
    log = write(tmp_path / "log.csv", rows())
    refused(furuta("validate", "qube", log), "rig.toml", word)


def test_a_mapping_survives_its_file(tmp_path: Path) -> None:
    mapping = RigMapping(
        t='a "name" = \\ with # signs',
        u="ü\n",
        unit_q1="counts",
        unit_q2="deg",
        encoder_counts=(2048.0, 4000.5),
        input_scale=1e-3,
        flip=(),
        skip=0.5,
        pendulum_zero="hanging",
    )
    save_mapping(tmp_path / "rig.toml", mapping, {"t": "a\nreason"}, "two\nlines")
    assert load_mapping(tmp_path / "rig.toml") == mapping
    assert RigMapping.from_dict(mapping.to_dict()) == mapping
    with pytest.raises(LogError, match="not known"):
        RigMapping.from_dict({"q3": "x"})


def test_a_message_offers_only_ways_that_lead_somewhere(tmp_path: Path) -> None:
    """What cannot be read as it is said either is not offered so, and `furuta init` does not send to itself."""
    broken = write(tmp_path / "broken.csv", rows(u=np.where(np.arange(len(rows()["u"])) == 40, np.nan, rows()["u"])))
    identified, looked = furuta("identify", broken, "-o", tmp_path / "rig.json"), furuta("init", broken)
    refused(identified, f"Look at it with `furuta init {broken}`")
    assert looked.exit_code == 2
    assert "--as-given" not in identified.stderr + looked.stderr
    assert "Look at it" not in looked.stderr


def test_a_log_given_twice_is_refused(tmp_path: Path) -> None:
    log = write(tmp_path / "log.csv", rows())
    result = furuta("identify", log, log, "-o", tmp_path / "rig.json")
    assert result.exit_code == 2
    assert "log.csv is given twice; expected each log once" in result.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["log.csv"]
