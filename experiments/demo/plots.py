"""Pictures of the demo: parameters against the truth, predictions over measurements, and the balanced episode."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from experiments.canvas import blank_figure

if TYPE_CHECKING:
    from identification.estimation.estimate import Estimate

_BLUE, _ORANGE, _GREY = "#2f6f9f", "#d9822b", "#9aa0a6"


def draw_parameters(fits: dict[str, Estimate], truth: dict[str, float], path: Path) -> None:
    """Errors of θ in per cent of the truth with 95 % error bars, for two fits; the scale is linear within 1 %."""
    figure = blank_figure(8.5, 4.2)
    axis = figure.subplots()
    true = np.array(list(truth.values()))
    place = np.arange(len(true))
    shifts = np.linspace(-0.13, 0.13, len(fits))
    for (label, e), shift, color in zip(fits.items(), shifts, (_ORANGE, _BLUE), strict=True):
        error, bar = 100 * (e.values[:9] / true - 1), 196 * e.std[:9] / np.abs(true)
        axis.errorbar(place + shift, error, bar, fmt="o", color=color, capsize=3, markersize=5, label=label)
    axis.axhline(0, color="black", linewidth=0.8)
    axis.set_yscale("symlog", linthresh=1.0, linscale=0.8)
    ticks = [-100, -30, -10, -3, -1, 0, 1, 3, 10, 30, 100]
    axis.set_yticks(ticks, [f"{t:+d}" if t else "0" for t in ticks])
    axis.minorticks_off()
    axis.set_ylim(-150, 400)
    axis.set_xticks(place, [f"θ{i + 1}" for i in place])
    axis.set_ylabel("error [% of the truth]")
    axis.set_title("Parameters against the bench's truth, 95 % error bars (linear within ±1 %)", fontsize=11)
    axis.grid(axis="y", color="#e5e5e5")
    figure.legend(loc="outside lower center", ncols=len(fits), fontsize=9)
    figure.savefig(path, dpi=120)


def draw_predictions(before: dict[str, Any], after: dict[str, Any], path: Path) -> None:
    """Held-out readings with predictions over them, and below each the errors; one column for each angle."""
    figure = blank_figure(11, 5.6)
    axes = figure.subplots(2, 2, sharex=True, height_ratios=(3, 1.6))
    t, measured = after["t"], after["measured"]
    sides = ((before, _ORANGE, "model (5)"), (after, _BLUE, "with the effect"))
    for column, name in enumerate(("arm q1", "pendulum q2")):
        top, bottom = axes[:, column]
        top.plot(t, measured[:, column], color=_GREY, linewidth=3.5, label="measured")
        for picture, color, label in sides:
            predicted = picture["predicted"][:, column]
            top.plot(t, predicted, color=color, linewidth=1.0, label=f"{label}, {picture['horizon']:g} s ahead")
            bottom.plot(t, 1e3 * (measured[:, column] - predicted), color=color, linewidth=0.8)
        top.set_title(name, fontsize=11)
        top.set_ylabel("rad")
        bottom.axhline(0, color="black", linewidth=0.6)
        bottom.set_ylabel("error [mrad]")
        bottom.set_xlabel("t [s]")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=9)
    figure.suptitle("Held-out log (another experiment): measured, and predicted by the identified plants", fontsize=12)
    figure.savefig(path, dpi=120)
