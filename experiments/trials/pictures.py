"""Pictures of the trials for pages and slides: confusion.png and power.png (report.html has its own, to hover over)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from experiments.canvas import blank_figure

from .power import PowerCurve
from .scoring import Outcome
from .summary import ALL

PICTURES = ("confusion.png", "power.png")
_RIGHT, _WRONG, _INK = "#0072b2", "#d55e00", "0.25"
_COLUMNS = 5


def draw_pictures(
    table: pd.DataFrame, curves: Mapping[str, PowerCurve], outcomes: Sequence[Outcome], folder: Path
) -> None:
    """Write both into `folder`. table: `summary.confusion`; curves: `summary.power_curves` of these outcomes."""
    _confusion(table).savefig(folder / PICTURES[0], dpi=110)
    _power(curves, outcomes).savefig(folder / PICTURES[1], dpi=110)


def _confusion(table: pd.DataFrame) -> Any:
    """Colours are shares of the row, numbers are trials; a line parts the names from "none", "unknown" …"""
    counts = table.to_numpy()
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    rows, columns = counts.shape
    figure = blank_figure(3.2 + 0.25 * columns, 2.6 + 0.21 * rows)
    axis = figure.subplots()
    axis.imshow(shares, cmap="Blues", vmin=0, vmax=1.2, aspect="auto")
    for i, j in zip(*np.nonzero(counts), strict=True):
        colour = "white" if shares[i, j] > 0.65 else "black"
        axis.text(j, i, str(counts[i, j]), ha="center", va="center", fontsize=8, color=colour)
    axis.set_xticks(range(columns), list(table.columns), rotation=60, ha="right", fontsize=8, rotation_mode="anchor")
    axis.set_yticks(range(rows), list(table.index), fontsize=8)
    axis.set_xticks(np.arange(columns) - 0.5, minor=True)
    axis.set_yticks(np.arange(rows) - 0.5, minor=True)
    axis.grid(which="minor", color="0.9", linewidth=0.6)
    axis.tick_params(which="both", length=0)
    axis.axvline(columns - 4.5, color=_INK, linewidth=1.0)  # the four last columns are no names
    axis.set_xlabel("named first")
    axis.set_ylabel("hidden")
    return figure


def _power(curves: Mapping[str, PowerCurve], outcomes: Sequence[Outcome]) -> Any:
    """A panel per effect: the curve and its 95 % band, a mark per trial above (named right) or below (not)."""
    height = math.ceil(max(len(curves), 1) / _COLUMNS)
    figure = blank_figure(14.0, 0.8 + 1.55 * height)
    axes = figure.subplots(height, _COLUMNS, sharex=True, sharey=True, squeeze=False)
    tried = [o for o in outcomes if o.kind == "library" and o.ratio is not None and o.ratio > 1.0 + 1e-6]
    visible = [(o.ratio or 1.0) - 1.0 for o in tried] or [0.01, 1.0]
    shown = np.geomspace(0.8 * min(visible), 1.25 * max(visible), 60)
    for axis in axes.flat[len(curves) :]:
        axis.axis("off")
    for axis, (name, curve) in zip(axes.flat, curves.items(), strict=False):
        low, median, high = curve.probability(1.0 + shown)
        axis.fill_between(shown, low, high, color="0.87", linewidth=0)
        axis.plot(shown, median, color=_INK, linewidth=1.5)
        here = [o for o in tried if name in (ALL, o.subject)]
        for right, place, colour, mark in ((True, 1.1, _RIGHT, "|"), (False, -0.1, _WRONG, "x")):
            some = [(o.ratio or 1.0) - 1.0 for o in here if o.right is right]
            axis.plot(some, [place] * len(some), mark, color=colour, markersize=6)
        axis.set_title(f"{name}, {curve.right} of {curve.trials}", fontsize=8.5)
        axis.set_xscale("log")
        axis.set_xlim(shown[0], shown[-1])
        axis.set_ylim(-0.2, 1.2)
        axis.set_yticks([0, 0.5, 1], ["0", "½", "1"])
        axis.grid(color="0.92")
    figure.supxlabel("error-to-noise ratio − 1", fontsize=10)
    figure.supylabel("share named right, alone or in a set of two", fontsize=10)
    return figure
