"""Colours stand out, and no curve is told from another by its colour alone."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import experiments.studio
from experiments.studio import charts

T = np.linspace(0.0, 1.0, 50)
STYLE = (Path(experiments.studio.__file__).parent / "style.css").read_text(encoding="utf-8")


def luminance(colour: str) -> float:
    """Relative luminance of #rrggbb, by WCAG 2."""
    channels = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return float(np.dot(linear, [0.2126, 0.7152, 0.0722]))


def contrast(one: str, other: str) -> float:
    light, dark = sorted((luminance(one), luminance(other)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


def test_the_measure_itself() -> None:
    assert contrast("#000000", "#ffffff") == pytest.approx(21.0)
    assert contrast("#767676", "#ffffff") == pytest.approx(4.54, abs=0.01)


@pytest.mark.parametrize("colour", [charts.MEASURED, charts.SIMULATED, charts.SECOND, charts.BEHIND])
def test_curves_stand_out_from_their_ground(colour: str) -> None:
    assert contrast(colour, "#ffffff") >= 3.0


def test_text_of_the_style_sheet_stands_out() -> None:
    grounds = ["#ffffff", "#f6f8fa", "#fff5f5"]
    dark = {"command", "command-title", "command-row"}
    for rule in re.finditer(r"([^{}]+)\{([^{}]*)\}", STYLE):
        found = re.search(r"(?<![-\w])color:\s*(#[0-9a-f]{6})", rule[2])
        if not found:
            continue
        on_dark = any(f".{name}" in rule[1] for name in dark)
        own = re.search(r"background:\s*(#[0-9a-f]{3,6})", rule[2])
        for ground in ["#24292f"] if on_dark else [own[1]] if own and len(own[1]) == 7 else grounds:
            assert contrast(found[1], ground) >= 4.5, rule[0]


def test_text_of_both_themes_stands_out() -> None:
    themes = [
        dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6})", body))
        for body in re.findall(r"^body(?:\.body--dark)? \{ (--[^}]*)\}", STYLE, re.MULTILINE)
    ]
    used = set(re.findall(r"(?<![-\w])color:\s*var\(--([\w-]+)\)", STYLE))
    assert len(themes) == 2
    assert {"ink", "quiet"} <= used
    for theme in themes:
        for ink in sorted(used):
            for ground in ("ground", "paper", "bad-ground"):
                assert contrast(theme[ink], theme[ground]) >= 4.5, (ink, ground)


@pytest.mark.parametrize(
    "option",
    [
        charts.overlay(T, np.zeros((50, 2)), np.ones((50, 2))),
        charts.log_panes(T, T, T, T, "V"),
    ],
)
def test_curves_in_one_pane_differ_by_more_than_colour(option: dict) -> None:
    panes: dict[int, list] = {}
    for series in option["series"]:
        panes.setdefault(series["xAxisIndex"], []).append(series)
    for together in panes.values():
        looks = [(s["lineStyle"]["type"], s["lineStyle"]["width"]) for s in together]
        assert len(set(looks)) == len(looks)


def test_a_picture_is_decimated_and_a_gap_stays_a_gap() -> None:
    y = np.sin(np.linspace(0, 9, 5000))
    y[2000:3000] = np.nan
    drawn = charts.points(np.linspace(0, 5, 5000), y)
    assert len(drawn) <= charts.MOST_POINTS
    assert any(value is None for _, value in drawn)
