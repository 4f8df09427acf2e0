"""The pictures as ECharts options: plain dictionaries, few points, curves that differ in width or dash too."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

MEASURED, SIMULATED, SECOND, BEHIND = "#30363d", "#0b5cad", "#a63d00", "#87909a"
MOST_POINTS = 700
Array = NDArray[np.float64]


def points(t: ArrayLike, y: ArrayLike, most: int = MOST_POINTS) -> list[list[float | None]]:
    """Samples as ECharts takes them, every m-th of many; NaN breaks the line."""
    t, y = np.asarray(t, dtype=float), np.asarray(y, dtype=float)
    every = max(1, -(-len(t) // most))
    pairs = zip(np.round(t[::every], 4).tolist(), y[::every].tolist(), strict=True)
    return [[a, None if b != b else float(f"{b:.5g}")] for a, b in pairs]


def line(
    name: str, data: list[Any], colour: str, axis: int = 0, dash: str = "solid", width: float = 1.6
) -> dict[str, Any]:
    """One curve on the axis-th pane."""
    return {
        "name": name,
        "type": "line",
        "data": data,
        "xAxisIndex": axis,
        "yAxisIndex": axis,
        "showSymbol": False,
        "animation": False,
        "connectNulls": False,
        "lineStyle": {"color": colour, "type": dash, "width": width},
        "itemStyle": {"color": colour},
    }


def panes(
    titles: Sequence[str], series: Sequence[dict[str, Any]], x: str = "time [s]", zoom: bool = True
) -> dict[str, Any]:
    """Panes one above the other with one time axis; titles: of their vertical axes."""
    n = len(titles)
    top, bottom, between = 11.0, 17.0 if zoom else 10.0, 5.0
    height = (100.0 - top - bottom - between * (n - 1)) / n
    grids = [
        {"left": 64, "right": 16, "top": f"{top + i * (height + between):.4g}%", "height": f"{height:.4g}%"}
        for i in range(n)
    ]
    grey = {"lineStyle": {"color": "#d0d7de"}}
    text = {"color": "#30363d"}
    names = list(dict.fromkeys(s["name"] for s in series))
    return {
        "animation": False,
        "textStyle": {"fontSize": 12},
        "legend": {"top": 0, "data": names, "textStyle": text},
        "tooltip": {"trigger": "axis"},
        "axisPointer": {"link": [{"xAxisIndex": "all"}]},
        "grid": grids,
        "xAxis": [
            {
                "type": "value",
                "gridIndex": i,
                "min": "dataMin",
                "max": "dataMax",
                "axisLabel": {"show": i == n - 1, "hideOverlap": True, "showMaxLabel": False, **text},
                "name": x if i == n - 1 else "",
                "nameLocation": "middle",
                "nameGap": 24,
                "nameTextStyle": text,
                "splitLine": grey,
            }
            for i in range(n)
        ],
        "yAxis": [
            {
                "type": "value",
                "gridIndex": i,
                "scale": True,
                "name": title,
                "nameLocation": "middle",
                "nameGap": 46,
                "nameTextStyle": text,
                "axisLabel": text,
                "splitNumber": 3,
                "splitLine": grey,
            }
            for i, title in enumerate(titles)
        ],
        "dataZoom": [{"type": "slider", "xAxisIndex": list(range(n)), "height": 18, "bottom": 4}] if zoom else [],
        "series": list(series),
    }


def log_panes(t: Array, q1: Array, q2: Array, u: Array, unit: str) -> dict[str, Any]:
    """A log as it is read."""
    series = [
        line("arm q1", points(t, q1), SIMULATED, 0),
        line("pendulum q2", points(t, q2), SECOND, 1),
        line("command u", points(t, u), MEASURED, 2, width=1.2),
    ]
    return panes(["q1 [rad]", "q2 [rad]", f"u [{unit}]"], series)


def simulated(t: Array, angles: Array) -> list[dict[str, Any]]:
    """The two curves that move in the what-if view, as a change of its chart."""
    return [{"name": "simulated", "data": points(t, angles[:, i])} for i in (0, 1)]


def overlay(t: Array, measured: Array, predicted: Array) -> dict[str, Any]:
    """Simulated over measured. The simulated curves come first, as `simulated` replaces them by their place."""
    series = [
        *(line("simulated", points(t, predicted[:, i]), SIMULATED, i, width=1.8) | {"z": 5} for i in (0, 1)),
        *(line("measured", points(t, measured[:, i]), BEHIND, i, width=5.0) for i in (0, 1)),
    ]
    return panes(["arm q1 [rad]", "pendulum q2 [rad]"], series, zoom=False)


def bars(names: Sequence[str], values: Sequence[float], unit: str) -> dict[str, Any]:
    """Horizontal bars, the largest on top."""
    order = sorted(range(len(names)), key=lambda i: values[i])
    return {
        "animation": False,
        "grid": {"left": 8, "right": 70, "top": 8, "bottom": 28, "containLabel": True},
        "xAxis": {
            "type": "value",
            "name": unit,
            "nameLocation": "middle",
            "nameGap": 22,
            "splitNumber": 4,
            "axisLabel": {"hideOverlap": True},
        },
        "yAxis": {"type": "category", "data": [names[i] for i in order], "axisLabel": {"color": "#30363d"}},
        "series": [
            {
                "type": "bar",
                "data": [round(values[i], 1) for i in order],
                "itemStyle": {"color": SIMULATED},
                "label": {"show": True, "position": "right"},
            }
        ],
    }


def scatter(x: Array, y: Array, x_title: str, y_title: str) -> dict[str, Any]:
    """Samples of one quantity against another."""
    every = max(1, -(-len(x) // 1500))
    data = np.column_stack([x, y])[::every]
    return {
        "animation": False,
        "grid": {"left": 64, "right": 16, "top": 12, "bottom": 40},
        "xAxis": {"type": "value", "scale": True, "name": x_title, "nameLocation": "middle", "nameGap": 24},
        "yAxis": {"type": "value", "scale": True, "name": y_title, "nameLocation": "middle", "nameGap": 46},
        "series": [
            {
                "type": "scatter",
                "symbolSize": 4,
                "data": [[float(f"{a:.5g}"), float(f"{b:.5g}")] for a, b in data],
                "itemStyle": {"color": SIMULATED, "opacity": 0.6},
            }
        ],
    }
