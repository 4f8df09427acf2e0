"""Pictures of a comparison, one file for each group of trials."""

from pathlib import Path
from typing import Any

import numpy as np

from .conditions import MAP_DELAYS, MAP_ERRORS, map_name
from .result import UNITS, Comparison

_TITLES = {
    "success": "success rate",
    "rms_q1": "rms arm angle",
    "rms_q2": "rms pendulum angle",
    "energy": "control energy",
    "roughness": "roughness of the command",
    "settling": "settling time",
    "largest_q1": "largest arm angle",
    "largest_push": "largest push survived",
}
_MAP_TITLE = "swing-ups that succeed [%], over what the controller does not know"
_TITLES |= {name: f"{_TITLES[name.removeprefix('worst_')]}, worst 5 %" for name in UNITS if name.startswith("worst_")}


def draw_comparison(comparison: Comparison, folder: Path) -> list[Path]:
    """Bars with 95 % intervals for groups of one condition, a map of success and rms q2 for the others.

    Writes `comparison_{group}.png` into an existing folder for each group of trials; the paths.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    paths = []
    for group in dict.fromkeys(comparison.groups.values()):
        rows = [name for name, g in comparison.groups.items() if g == group]
        names = [c for c in comparison.scores if any(r in comparison.scores[c] for r in rows)]
        if not names:
            continue
        figure = Figure(layout="constrained")
        FigureCanvasAgg(figure)
        if group == "map":
            _heat(figure, comparison, names)
        elif len(rows) == 1:
            _bars(figure, comparison, rows[0], names)
        else:
            _maps(figure, comparison, rows, names)
        title = f"{group.replace('_', ' ')}, 95 % intervals" if len(rows) == 1 else group
        figure.suptitle(_MAP_TITLE if group == "map" else title, fontsize=10)
        path = folder / f"comparison_{group}.png"
        figure.savefig(path, dpi=110)
        paths.append(path)
    return paths


def _bars(figure: Any, comparison: Comparison, row: str, names: list[str]) -> None:
    figures = list(comparison.scores[names[0]][row])
    figure.set_size_inches(2.0 + 2.2 * len(figures), 1.2 + 0.35 * len(names))
    axes = figure.subplots(1, len(figures), sharey=True, squeeze=False)[0]
    for axis, key in zip(axes, figures, strict=True):
        got = [comparison.scores[name][row][key] for name in names]
        value = np.array([x.value for x in got])
        error = np.clip([[x.value - x.low for x in got], [x.high - x.value for x in got]], 0.0, None)
        axis.barh(names, value, xerr=error, color="#5b84b1", error_kw={"ecolor": "#222222", "capsize": 2})
        unit = UNITS[key].format(u=comparison.plant.unit)
        axis.set_title(_TITLES[key] + (f" [{unit}]" if unit else ""), fontsize=9)
        axis.set_xlim(left=0.0)
        axis.tick_params(labelsize=8)
    axes[0].invert_yaxis()


def _maps(figure: Any, comparison: Comparison, rows: list[str], names: list[str]) -> None:
    figure.set_size_inches(3.5 + 1.5 * len(names), 1.8 + 0.28 * len(rows))
    axes = figure.subplots(1, 2, sharey=True)
    second = "settling" if "swing-up" in rows else "rms_q2"
    for axis, key, scale in zip(axes, ("success", second), ("RdYlGn", "YlOrRd"), strict=True):
        value = np.array([[_value(comparison, name, row, key) for name in names] for row in rows])
        limits = {"vmin": 0.0, "vmax": 1.0} if key == "success" else {"vmin": 0.0}
        axis.imshow(value, cmap=scale, aspect="auto", **limits)
        for i, line in enumerate(value):
            for j, x in enumerate(line):
                axis.text(j, i, "–" if np.isnan(x) else f"{x:.2g}", ha="center", va="center", fontsize=7)
        axis.set_xticks(range(len(names)), names, rotation=35, ha="right", fontsize=8)
        axis.set_yticks(range(len(rows)), rows, fontsize=8)
        title = "time to upright" if key == "settling" else _TITLES[key]
        axis.set_title(title + (f" [{UNITS[key]}]" if UNITS[key] else ""), fontsize=9)


def _heat(figure: Any, comparison: Comparison, names: list[str]) -> None:
    """Success in % over delay and error, a panel for each controller."""
    across = min(3, len(names))
    down = -(-len(names) // across)
    figure.set_size_inches(1.2 + 3.4 * across, 1.0 + 2.0 * down)
    axes = figure.subplots(down, across, sharex=True, sharey=True, squeeze=False)
    for axis in axes.flat[len(names) :]:
        axis.set_visible(False)
    for axis, name in zip(axes.flat, names, strict=False):
        rows = [[_value(comparison, name, map_name(ms, error), "success") for ms in MAP_DELAYS] for error in MAP_ERRORS]
        axis.imshow(rows, cmap="RdYlGn", vmin=0.0, vmax=1.0, aspect="auto", origin="lower")
        for i, row in enumerate(rows):
            for j, x in enumerate(row):
                colour = "white" if x < 0.15 or x > 0.85 else "black"
                text = "–" if np.isnan(x) else f"{100 * x:.0f}"
                axis.text(j, i, text, ha="center", va="center", fontsize=8, color=colour)
        axis.set_title(name, fontsize=9)
        axis.set_xticks(range(len(MAP_DELAYS)), [str(ms) for ms in MAP_DELAYS], fontsize=8)
        axis.set_yticks(range(len(MAP_ERRORS)), [f"±{error}" if error else "0" for error in MAP_ERRORS], fontsize=8)
    figure.supxlabel("command later by [ms]", fontsize=9)
    figure.supylabel("error of the parts [%]", fontsize=9)


def _value(comparison: Comparison, name: str, row: str, key: str) -> float:
    figures = comparison.scores[name].get(row, {})
    return figures[key].value if key in figures else np.nan
