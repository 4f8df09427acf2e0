"""The demo: its story, and what it shows while it works."""

from __future__ import annotations

import io
import json
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from experiments.cli import steps as steps_module
from experiments.demo.policies import in_tenths
from identification.logs.log import write_log
from identification.logs.reading import read_log
from tests.commands import furuta


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("whole", [False, pytest.param(True, marks=pytest.mark.thorough)], ids=["short", "whole"])
def test_the_demo_tells_its_story_and_ends_well(
    whole: bool, tmp_path: Path, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In short: a quarter of its logs, in which the whole library finds what is hidden, and policies of a few steps."""
    from experiments.demo import policies, story

    for name in () if whole else ("FITTED", "HELD_OUT"):
        file = tmp_path_factory.mktemp("logs") / f"{name}.csv"
        write_log(file, read_log(getattr(story, name)).slice(stop=5.0))
        monkeypatch.setattr(story, name, file)
    lines: list[str] = []
    works: list[str] = []

    @contextmanager
    def work(text: str) -> Iterator[Callable[[str], None]]:
        works.append(text)
        yield lambda more: works.append(f"{text}: {more}")

    figures = story.run_demo(
        tmp_path, say=lambda line="": lines.append(line), steps=policies.STEPS if whole else 20_000, work=work
    )
    assert [line.split("  ")[0].strip() for line in lines if " of 6  " in line] == [f"{n} of 6" for n in range(1, 7)]
    assert list(dict.fromkeys(text.split(",")[0] for text in works)) == [f"{n} of 6" for n in range(2, 7)]
    assert "4 of 6, diagnosing: locating the gap" in works
    assert works.count("6 of 6, training on the plant with the effect: 100 %") == 1
    written = {path.name for path in tmp_path.iterdir()}
    files = {"rig.json", "plant.json", "diagnosis.json", "report.html", "gap.json", "demo.json"}
    files |= {"prediction.png", "parameters.png", "policy_without.zip", "policy_with.zip"}
    assert files | {"comparison.json", "comparison_without.json"} <= written
    assert figures["held"]["with"] == {"lqr": 1.0, "lqg": 1.0}
    # what the bench hides is found, θ with it is right within its error bars, and the held-out gap closes
    assert [effect["name"] for effect in figures["diagnosis"]["effects"]] == ["input_delay"]
    assert figures["largest_error_in_std"]["effect added"] < 4
    assert figures["diagnosis"]["gap"]["closed_interval"][0] > 0.95
    # all that had time to learn hold the rig itself, and what was made with the effect does so better
    rows = {(row["controller"], row["made"]): row for row in figures["rig"]["rows"]}
    assert set(rows) == {(name, side) for name in ("lqr", "policy") for side in ("without", "with")}
    assert all(row["success"]["value"] == 1.0 for (name, _), row in rows.items() if whole or name == "lqr")
    assert rows["lqr", "with"]["rms_q1"]["value"] < 0.85 * rows["lqr", "without"]["rms_q1"]["value"]
    if whole:
        assert rows["policy", "with"]["rms_q2"]["value"] < rows["policy", "without"]["rms_q2"]["value"]
        assert rows["policy", "with"]["energy"]["value"] < 0.8 * rows["policy", "without"]["energy"]["value"]
        assert "∫u² dt -" in figures["rig"]["with_against_without"]["policy"]
    told = "\n".join(lines)
    for heading in ("What was found", "What to look at", "Caveats"):
        assert heading in told
    for name, verdict in figures["rig"]["with_against_without"].items():
        assert f"{name} with the effect, against without it: {verdict}" in told
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "On the rig itself" in page
    assert "The command reaches the motor" in page
    assert len(page.encode()) < 2e6
    assert json.loads((tmp_path / "demo.json").read_text()) == json.loads(json.dumps(figures))


@pytest.mark.parametrize("terminal", [False, True])
def test_the_demo_shows_its_work_beside_its_story(
    terminal: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The story may be piped: what is shown on the terminal takes none of it."""
    shown = io.StringIO()

    def story(out: Path, *, say: Any, work: Any, **rest: Any) -> dict[str, Any]:
        say("2 of 6  Identify")
        with work("2 of 6, fitting") as tell:
            tell("10 %")
        say("done")
        return {}

    monkeypatch.setattr("experiments.demo.story.run_demo", story)
    monkeypatch.setattr(steps_module, "errors", Console(file=shown, force_terminal=terminal, width=80))
    result = furuta("demo", "--out", tmp_path / "demo")
    assert (result.exit_code, result.stdout) == (0, "2 of 6  Identify\ndone\n")
    assert "2 of 6, fitting" in shown.getvalue()
    assert "2 of 6, fitting: 10 %" in shown.getvalue()
    assert bool(re.search(r"^\[\d+ s\] 2 of 6, fitting: 10 %$", shown.getvalue(), re.MULTILINE)) is not terminal


def test_a_training_of_the_demo_is_told_in_tenths() -> None:
    told: list[str] = []
    count = in_tenths(told.append)
    for done in range(0, 1001, 7):
        count(done, 1000)
    count(1240, 1000)
    assert told == [f"{percent} %" for percent in range(10, 101, 10)]
