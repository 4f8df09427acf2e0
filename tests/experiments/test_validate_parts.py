"""`furuta validate` on several logs: where the plant fails, log by log and by the kind of experiment."""

from __future__ import annotations

import json
from dataclasses import replace
from html import unescape
from pathlib import Path

import numpy as np
import pytest

from experiments.report.by_part import parts_of
from furuta_gym.plant import Plant
from identification.logs.log import Log, write_log
from identification.validation.gap import validate
from tests.commands import furuta
from tests.factories import hanging_log, loop_log

pytest.importorskip("plotly", reason="the page needs the extra 'report'")

from experiments.report.validation_page import validation_page


@pytest.fixture(scope="module")
def rig() -> tuple[Plant, Log, Log]:
    """A plant with a cable, an upright log of it, and a hanging log of a rig without the cable."""
    upright, plant = loop_log("arm_spring", duration=6.0)
    return plant, replace(upright, source="upright.csv"), replace(hanging_log(), source="hanging.csv")


def test_a_plant_that_fails_in_one_kind_of_experiment_is_told_so(rig: tuple[Plant, Log, Log], tmp_path: Path) -> None:
    plant, upright, hanging = rig
    plant.save(tmp_path / "rig.json")
    write_log(tmp_path / "upright.csv", upright)
    write_log(tmp_path / "hanging.csv", replace(hanging, encoder_counts=(2048, 2048)))
    files = [tmp_path / name for name in ("upright.csv", "hanging.csv")]
    result = furuta("validate", tmp_path / "rig.json", *files, "--json", tmp_path / "gap.json")
    assert result.exit_code == 0, result.output
    said = result.stdout.split("Next:")[0]
    assert "upright.csv (upright)" in said
    assert "hanging.csv (hanging)" in said
    assert "on hanging logs" in said
    found = json.loads((tmp_path / "gap.json").read_text())
    assert [one["name"] for one in found["by_log"]] == ["upright.csv", "hanging.csv"]
    assert found["by_log"][1]["ratio_to_floor"] == pytest.approx(found["by_kind"]["hanging"]["ratio_to_floor"])
    assert found["by_kind"]["upright"]["ratio_to_floor"] < 1.3 < 2.0 < found["by_kind"]["hanging"]["ratio_to_floor"]


def test_parts_add_up_to_the_whole(rig: tuple[Plant, Log, Log]) -> None:
    plant, upright, hanging = rig
    gap = validate(plant, [upright, hanging])
    parts = parts_of(plant, gap, [upright, hanging])
    windows = [np.sum(gap.log == i) for i in range(2)]
    squares = sum(n * one.rms**2 for n, one in zip(windows, parts.by_log, strict=True) if one.rms is not None)
    np.testing.assert_allclose(squares, sum(windows) * gap.rms**2, rtol=1e-9)


def test_logs_of_one_kind_are_not_predicted_again(rig: tuple[Plant, Log, Log]) -> None:
    plant, upright, _ = rig
    other = loop_log("arm_spring", duration=6.0, seed=3)[0]
    assert parts_of(plant, validate(plant, [upright, other]), [upright, other]).by_kind == {}


def test_a_log_too_short_to_be_predicted_is_named(rig: tuple[Plant, Log, Log]) -> None:
    plant, upright, _ = rig
    short = replace(upright.slice(0.0, 0.5), source="short.csv")
    parts = parts_of(plant, validate(plant, [upright, short]), [upright, short])
    assert "short.csv (upright)  too short to be predicted" in str(parts)
    assert json.dumps(parts.to_dict(), allow_nan=False)


def test_the_page_has_both_tables(rig: tuple[Plant, Log, Log]) -> None:
    pytest.importorskip("plotly")
    from experiments.report import render

    plant, upright, hanging = rig
    gap = validate(plant, [upright, hanging])
    page = render(
        validation_page(
            gap,
            plant,
            [upright, hanging],
            "rig.json",
            "furuta diagnose LOG",
            (),
            parts_of(plant, gap, [upright, hanging]),
        )
    )
    assert "Each over a noise floor of its own." in page
    assert "hanging.csv" in page


def test_ctrl_c_while_the_page_is_made_leaves_nothing_new(
    rig: tuple[Plant, Log, Log], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Pictures were made by then, and the JSON was known."""

    def stopped(*_: object) -> None:
        raise KeyboardInterrupt

    plant, upright, _ = rig
    plant.save(tmp_path / "rig.json")
    write_log(tmp_path / "log.csv", upright)
    monkeypatch.setattr("experiments.report.render", stopped)
    into = ("--plots", tmp_path / "plots", "--report", tmp_path / "page.html", "--json", tmp_path / "gap.json")
    result = furuta("validate", tmp_path / "rig.json", tmp_path / "log.csv", *into)
    assert result.exit_code == 130
    assert "Nothing was written" in result.stderr
    assert {path.name for path in tmp_path.iterdir()} == {"rig.json", "log.csv"}


def test_the_page_and_the_terminal_name_the_same_next_command(rig: tuple[Plant, Log, Log], tmp_path: Path) -> None:
    """With the folders of the logs, and as they were read."""
    plant, upright, _ = rig
    (tmp_path / "my data").mkdir()
    log, page = tmp_path / "my data" / "new.csv", tmp_path / "page.html"
    write_log(log, upright)
    plant.replace(theta=1.5 * plant.theta).save(tmp_path / "rig.json")
    result = furuta("validate", tmp_path / "rig.json", log, "--skip", 1, "--report", page)
    assert result.exit_code == 0, result.output
    command = f"furuta diagnose LOG --skip 1 --held-out '{log}' -o diagnosis"
    assert f"Next: {command}\n" in result.stdout
    assert command in unescape(page.read_text(encoding="utf-8"))
