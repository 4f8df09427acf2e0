"""Pictures of a comparison, one file for each group of trials."""

from pathlib import Path
from typing import Any

import numpy as np

from .comparison import UNITS, Comparison

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
        if len(rows) == 1:
            _bars(figure, comparison, rows[0], names)
        else:
            _maps(figure, comparison, rows, names)
        figure.suptitle(f"{group.replace('_', ' ')}, 95 % intervals" if len(rows) == 1 else group)
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


def _value(comparison: Comparison, name: str, row: str, key: str) -> float:
    figures = comparison.scores[name].get(row, {})
    return figures[key].value if key in figures else np.nan
