"""Code that how-to pages show, run as it stands."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest

from tests.commands import furuta

DOCS = Path(__file__).resolve().parent.parent / "docs"
sys.path.insert(0, str(DOCS))

import run_pages  # noqa: E402


def test_the_weights_of_another_framework_are_copied_and_exported(tmp_path: Path) -> None:
    """docs/how-to/own_training_script.md: a network of PyTorch, as a policy of stable-baselines3 and in C."""
    from controllers import export_policy_c, make_controller
    from furuta_gym.plant import Effect, Plant

    late = Plant.resolve("qube").with_effects(Effect("input_delay", {"d": 0.008}))
    late.save(tmp_path / "late.json")
    page = (DOCS / "how-to" / "own_training_script.md").read_text().partition("### The same network in C")[2]
    (tmp_path / "page.md").write_text(page)
    ((code, shown),) = run_pages.kept(tmp_path / "page.md")
    (said,) = run_pages.run([code], tmp_path, "copied")
    assert said == shown
    export_policy_c(make_controller(str(tmp_path / "copied.zip"), late, 0.02, trust=True), tmp_path / "copied.h")
    assert "furuta_copied_step" in (tmp_path / "copied.h").read_text()


def test_the_rule_of_the_standing_encoder_can_be_left_out(tmp_path: Path) -> None:
    """docs/how-to/first_run.md."""
    from furuta_gym.plant import Plant

    Plant.resolve("qube").save(tmp_path / "final.json")
    ((code, _),) = run_pages.kept(DOCS / "how-to" / "first_run.md")
    run_pages.run([code], tmp_path, "first_run")
    assert "FURUTA_LQR_ARM" in (tmp_path / "lqr.h").read_text()


@pytest.mark.thorough
def test_the_four_commands_print_what_their_page_shows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """docs/how-to/own_rig.md."""
    pytest.importorskip("jinja2", reason="furuta diagnose needs the extra 'report'")
    page = (DOCS / "how-to" / "own_rig.md").read_text().partition("## What the four commands print")[2]
    block = page.partition("```text\n")[2].partition("```")[0]
    logs = DOCS.parent / "experiments" / "demo" / "logs"
    for name, source in (("log1.csv", "paper.csv"), ("log2.csv", "wide.csv")):
        shutil.copy(logs / source, tmp_path / name)
    monkeypatch.chdir(tmp_path)
    commands = [part.splitlines() for part in block.split("$ furuta ")[1:]]
    assert len(commands) == 4
    for line, *shown in commands:
        result = furuta(*line.split())
        assert result.exit_code == 0, result.output
        printed = " ".join(result.output.split())
        for one in shown:
            assert " ".join(one.removesuffix("…").split()) in printed, one
