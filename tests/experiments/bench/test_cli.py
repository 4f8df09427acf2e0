"""The two commands of the bench."""

import json

import pytest
from typer.testing import CliRunner

from experiments.bench import EffectSize, PendulumLost, list_rigs
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


def test_size_shows_how_plain_an_effect_is(monkeypatch):
    def measured(rig, experiment, seed):
        if rig.kind.name == "desk":
            raise PendulumLost("fell", None)
        return EffectSize(0.0, 0.0, 1.0 + rig.effects[0].strength, 2.0, 0.5, 0.4)

    monkeypatch.setattr("experiments.bench.cli.effect_size", measured)
    chosen = ["size", "--effect", "input_offset", "--set", "table3", "--set", "desk", "--strength", "0.5"]
    shown = run.invoke(app, [*chosen, "--json"])
    assert shown.exit_code == 0, shown.output
    assert json.loads(shown.stdout) == {"input_offset": {"table3": 1.5, "desk": None}}
    table = run.invoke(app, chosen).stdout
    assert "1.50" in table
    assert "lost" in table
    wrong = run.invoke(app, ["size", "--effect", "input_ofset", "--set", "table3"])
    assert wrong.exit_code == 2
    assert "input_offset" in wrong.output


def test_the_next_command_has_a_name_with_a_space_in_quotes(tmp_path):
    log = tmp_path / "my log.csv"
    assert f"Next: furuta diagnose '{log}' -o diagnosis" in _record(out=log).output
