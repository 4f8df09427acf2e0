"""The two commands of the bench."""

import json

import pytest
from typer.testing import CliRunner

from experiments.bench import list_rigs
from experiments.bench.cli import app

run = CliRunner()


def _record(*more, rig="rig-03", out="log.csv"):
    return run.invoke(app, ["record", "--rig", rig, "--duration", "2", "-o", str(out), *more])


def test_list_names_rigs_and_experiments_but_no_effects():
    shown = run.invoke(app, ["list", "--json"])
    assert shown.exit_code == 0
    facts = json.loads(shown.stdout)
    assert [r["name"] for r in facts["rigs"]] == list(list_rigs())
    assert {e["name"] for e in facts["experiments"]} >= {"paper", "wide", "dither", "hanging-chirp", "free-decay"}
    from experiments.bench import catalogue

    table = run.invoke(app, ["list"])
    assert table.exit_code == 0
    assert not [name for name in catalogue() if name in shown.stdout + table.stdout]


def test_record_writes_a_log_and_the_truth_only_with_reveal(tmp_path):
    done = _record("--seed", "1", out=tmp_path / "log.csv")
    assert done.exit_code == 0, done.output
    assert [p.name for p in tmp_path.iterdir()] == ["log.csv"]
    assert "effects" not in done.output
    told = _record("--seed", "1", "--reveal", out=tmp_path / "told.csv")
    assert told.exit_code == 0
    assert '"effects"' in told.stdout
    assert json.loads((tmp_path / "told.truth.json").read_text())["rig"] == "rig-03"
    assert (tmp_path / "told.csv").read_text() == (tmp_path / "log.csv").read_text()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"rig": "rig-99"}, "rig-01"),
        ({"more": ("--experiment", "dance")}, "hanging-chirp"),
        ({"more": ("--duration", "0")}, "duration"),
        ({"more": ("--sample-time", "3")}, "sample_time"),
        ({"more": ("--seed", "-1")}, "seed"),
        ({"more": ("--frobnicate",)}, "frobnicate"),
        ({"name": "log.xlsx"}, ".csv"),
    ],
)
def test_errors_end_with_2_say_what_is_allowed_and_write_nothing(tmp_path, arguments, says):
    done = _record(
        *arguments.get("more", ()), rig=arguments.get("rig", "rig-03"), out=tmp_path / arguments.get("name", "log.csv")
    )
    assert done.exit_code == 2
    assert says in done.output
    assert not list(tmp_path.iterdir())
