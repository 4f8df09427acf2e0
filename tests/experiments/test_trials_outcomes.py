"""Outcomes that are kept can be read and counted again; the documented figures are those of the kept ones."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from experiments.trials.outcomes import outcomes_table, read_outcomes
from experiments.trials.report import FILES, headline, limits_rows
from experiments.trials.scoring import Outcome
from experiments.trials.summary import power_curves, summarize

DOCS = Path(__file__).parents[2] / "docs"
KEPT = DOCS / "data" / "trials_outcomes.csv"
PRESENT = (
    "42",
    "44",
    "46",
    "47",
    "48",
    "49",
    "50",
    "51",
    "52",
    "53",
    "54",
    "55",
    "56",
    "57",
    "58",
    "59",
    "60",
    "61",
    "65",
    "65b",
    "65c",
    "66",
    "67",
    "68",
    "71",
    "71b",
    "73",
)
PRESENT_COMPOSITE = (
    "41_composite",
    "43_composite",
    "45_composite",
    "51_composite",
    "55_composite",
    "56_composite",
    "59_composite",
    "62_composite",
    "66_composite",
    "71_composite",
)

names = st.from_regex(r"[a-zφω][a-z0-9_φω]{0,12}", fullmatch=True)
numbers = st.none() | st.floats(0, 1e6)
outcomes = st.builds(
    Outcome,
    id=names,
    kind=names,
    subject=names,
    rig=names,
    form=st.sampled_from(("", "table", "table+bench", "null", "NA")),
    ratio=numbers,
    result=names,
    named=st.lists(names, max_size=3).map(tuple),
    found=st.integers(0, 5),
    false=st.integers(0, 5),
    inside=st.booleans(),
    covered=st.dictionaries(names, st.booleans(), max_size=3),
    leftover=st.booleans(),
    reported_absorbed=st.booleans(),
    closed_fraction=numbers | st.floats(-50, 1),
    after_over_floor=numbers,
    runtime_s=numbers,
    code=st.sampled_from(("", "78caeae6d889")),
)


@given(some=st.lists(outcomes, min_size=1, max_size=5))
@settings(max_examples=50, deadline=None)
def test_what_is_written_is_read_again(some, tmp_path_factory):
    file = tmp_path_factory.mktemp("kept") / "outcomes.csv"
    outcomes_table(some).to_csv(file, index=False)
    assert read_outcomes(file) == some


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text.replace("runtime_s", "seconds"), "lacks runtime_s"),
        (lambda text: text.replace("True", "perhaps"), "line 2: cannot read 'perhaps'"),
        (lambda text: text.replace("{}", "{"), "line 2: cannot read"),
        (lambda text: "", "is no table"),
    ],
)
def test_what_cannot_be_read_is_said(change, message, tmp_path):
    one = Outcome("a", "none", "none", "servo", "", None, "right", (), 0, 0, True, {}, False, False, None, None, 1.0)
    file = tmp_path / "outcomes.csv"
    outcomes_table([one]).to_csv(file, index=False)
    file.write_text(change(file.read_text(encoding="utf-8")), encoding="utf-8")
    with pytest.raises(ValueError, match=message):
        read_outcomes(file)


def _rows(page: str) -> set[tuple[str, ...]]:
    """Rows of the tables of a page, as cells."""
    lines = (DOCS / page).read_text(encoding="utf-8").splitlines()
    return {tuple(cell.strip() for cell in line.strip("|").split("|")) for line in lines}


def test_the_documented_figures_are_those_of_the_kept_outcomes():
    outcomes, more = read_outcomes(KEPT), read_outcomes(DOCS / "data" / "power_outcomes.csv")
    summary = summarize(outcomes)
    for name, rows in (
        ("research-log/diagnosis_draws.md", headline(summary)),
        ("diagnosis_trials.md", limits_rows(summary, power_curves([*outcomes, *more]))),
    ):
        lines = _rows(name)
        for row in rows:
            assert tuple(row) in lines, f"docs/{name} has no row: | {' | '.join(row)} |"


def test_the_documented_figures_of_each_run_are_those_of_its_file():
    for run, name in (
        ("62_composite", "research-log/diagnosis_runs.md"),
        ("61", "research-log/diagnosis_runs.md"),
        ("65", "research-log/diagnosis_runs.md"),
        ("65b", "research-log/diagnosis_runs.md"),
        ("65c", "research-log/diagnosis_runs.md"),
        ("66", "research-log/diagnosis_runs.md"),
        ("67", "research-log/diagnosis_runs.md"),
        ("66_composite", "research-log/diagnosis_runs.md"),
        ("68", "research-log/diagnosis_runs.md"),
        ("71", "research-log/diagnosis_runs.md"),
        ("71_composite", "research-log/diagnosis_runs.md"),
        ("71b", "research-log/diagnosis_runs.md"),
        ("73", "research-log/diagnosis_runs.md"),
        ("60", "research-log/diagnosis_runs.md"),
        ("59", "research-log/diagnosis_runs.md"),
        ("58", "research-log/diagnosis_runs.md"),
        ("57", "research-log/diagnosis_runs.md"),
        ("56", "research-log/diagnosis_runs.md"),
        ("55", "research-log/diagnosis_runs.md"),
        ("54", "research-log/diagnosis_runs.md"),
        ("53", "research-log/diagnosis_runs.md"),
        ("52", "research-log/diagnosis_runs.md"),
        ("51", "research-log/diagnosis_runs.md"),
        ("51_composite", "research-log/diagnosis_runs.md"),
        ("50", "research-log/diagnosis_runs.md"),
        ("49", "research-log/diagnosis_runs.md"),
        ("48", "research-log/diagnosis_runs.md"),
        ("47", "research-log/diagnosis_runs.md"),
        ("46", "research-log/diagnosis_runs.md"),
        ("45_composite", "research-log/diagnosis_runs.md"),
        ("44", "research-log/diagnosis_runs.md"),
        ("43_composite", "research-log/diagnosis_runs.md"),
        ("42", "research-log/diagnosis_runs.md"),
        ("41_composite", "research-log/diagnosis_runs.md"),
        ("38", "research-log/diagnosis_draws.md"),
        ("39_composite", "research-log/diagnosis_draws.md"),
        ("34", "research-log/diagnosis_draws.md"),
        ("35_composite", "research-log/diagnosis_draws.md"),
        ("33", "research-log/diagnosis_draws.md"),
        ("33_strong", "research-log/diagnosis_draws.md"),
        ("30", "research-log/diagnosis_draws.md"),
    ):
        lines = _rows(name)
        for row in headline(summarize(read_outcomes(DOCS / "data" / f"trials_outcomes_{run}.csv"))):
            assert tuple(row) in lines, f"docs/{name} has no row: | {' | '.join(row)} |"


@pytest.mark.parametrize("together", [PRESENT, PRESENT_COMPOSITE])
def test_the_page_counts_the_runs_of_the_present_library_together(together: tuple[str, ...]) -> None:
    page = (DOCS / "diagnosis_trials.md").read_text(encoding="utf-8")
    lines = _rows("diagnosis_trials.md")
    files = [DOCS / "data" / f"trials_outcomes_{run}.csv" for run in together]
    assert all(f"docs/data/{file.name}" in page for file in files)
    for row in headline(summarize([outcome for file in files for outcome in read_outcomes(file)])):
        assert tuple(row) in lines, f"docs/diagnosis_trials.md has no row: | {' | '.join(row)} |"


REPEATED = (  # rows of the table whose figures stand in sentences too, of the page's first table and of two others
    "one effect, error-to-noise ratio 1.1 to 10: named right, alone",
    "one effect, error-to-noise ratio above 10: named right, alone",
    "nothing to name: false alarms",
    "outside the library: something unknown is said to be there",
)


def test_sentences_repeat_the_counts_of_the_table() -> None:
    files = [DOCS / "data" / f"trials_outcomes_{run}.csv" for run in PRESENT]
    rows = dict(headline(summarize([outcome for file in files for outcome in read_outcomes(file)])))
    page = (DOCS / "diagnosis_trials.md").read_text(encoding="utf-8")
    short = page[page.index("**In short:**") :].split("\n## ")[0]
    tables = [(DOCS / name).read_text(encoding="utf-8") for name in ("figures.md", "../README.md")]
    for label in REPEATED:
        count, _, interval = rows[label].partition(" = ")
        interval = interval[interval.index("(") :]
        for text in tables:
            assert f"{count} {interval}" in text, f"{label}: {count} {interval}"
        hits, _, of = count.partition(" of ")
        assert re.search(rf"\b({hits}|None) of {of}\b", short), f"{label}: {count}"
        assert f"{count} {interval}" in short, f"{label}: {count} {interval}"


def test_the_command_counts_a_kept_file_again(monkeypatch):
    import typer

    from experiments.trials.recount import main

    app = typer.Typer()
    app.command()(main)
    done = CliRunner().invoke(app, [str(KEPT)])
    assert done.exit_code == 0
    assert f"{len(read_outcomes(KEPT))} trials" in done.output
    assert CliRunner().invoke(app, ["nowhere.csv"]).exit_code != 0


def test_runs_are_counted_together_but_no_trial_twice(tmp_path):
    import typer

    from experiments.trials.recount import main

    one = Outcome("a", "none", "none", "servo", "", None, "right", (), 0, 0, True, {}, False, False, None, None, 1.0)
    for name, some in (("one.csv", [one]), ("two.csv", [replace(one, id="b", code="78caeae6d889")])):
        outcomes_table(some).to_csv(tmp_path / name, index=False)
    app = typer.Typer()
    app.command()(main)
    done = CliRunner().invoke(app, [str(tmp_path / name) for name in ("one.csv", "two.csv")])
    assert "2 trials" in done.output
    assert "| answers come from different codes | 1 of not kept, 1 of 78caeae6d889 |" in done.output
    twice = CliRunner().invoke(app, [str(tmp_path / "one.csv")] * 2)
    assert twice.exit_code != 0
    assert "twice" in str(twice.exception)


def test_trials_of_other_sizes_count_for_the_curves_only(tmp_path):
    import typer

    from experiments.trials.recount import main

    pytest.importorskip("plotly")
    small = Outcome(
        "a", "library", "arm_spring", "servo", "table", 1.2, "missed", (), 0, 0, False, {}, False, False, *[None] * 3
    )
    plain = replace(small, id="b", ratio=2.0, result="right", named=("arm_spring",), inside=True)
    for name, some in (("draw.csv", [plain]), ("power.csv", [small])):
        outcomes_table(some).to_csv(tmp_path / name, index=False)
    app = typer.Typer()
    app.command()(main)
    out = tmp_path / "out"
    done = CliRunner().invoke(app, [str(tmp_path / "draw.csv"), "--power", str(tmp_path / "power.csv"), "-o", str(out)])
    assert done.exit_code == 0, done.output
    assert "1 of 1 = 100 %" in done.output
    curves = pd.read_csv(out / "power.csv", index_col="effect")
    assert list(curves.loc["arm_spring", ["trials", "named_right"]]) == [2, 1]
    assert all((out / name).stat().st_size > 50 for name in FILES)
    assert "counted again" in (out / "report.html").read_text(encoding="utf-8")
