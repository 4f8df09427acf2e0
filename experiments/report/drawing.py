"""How every figure of the report looks: colours, bands, sizes, and how it gets into the page."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

# Okabe & Ito's palette, which colour-blind readers can tell apart; dashes and markers say the same again
BEFORE, AFTER, MEASURED, FLOOR, MARK = "#D55E00", "#0072B2", "#333333", "#009E73", "rgba(240,228,66,0.22)"
LAW = "#CC79A7"
DASH = {BEFORE: "dot", AFTER: "solid", MEASURED: "solid", FLOOR: "dash", LAW: "solid"}
MARKER = {BEFORE: "circle-open", AFTER: "diamond"}
MOST_POINTS = 1200  # of one trace

_INK, _GRID = "#1a1a1a", "#dddddd"

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Drawing:
    """A figure in the page: its name there, Plotly's JSON, what it shows in words, and its height [px]."""

    name: str
    json: str
    alt: str
    caption: str
    height: int
    small: bool = False


def drawing(name: str, figure: go.Figure, alt: str, caption: str, height: int, small: bool = False) -> Drawing:
    """Finish a figure: fonts, margins, no template (Plotly's own is 7 kB in every figure)."""
    figure.update_layout(
        template=go.layout.Template(),
        height=height,
        font={"family": "system-ui, sans-serif", "size": 11 if small else 13, "color": _INK},
        paper_bgcolor="white",
        plot_bgcolor=figure.layout["plot_bgcolor"] or "white",
        margin={"l": 10, "r": 12, "t": 8 if small else 36, "b": 42 if small else 58},
        legend={"orientation": "h", "x": 0, "y": 1.0, "yanchor": "bottom", "xanchor": "left"},
        hoverlabel={"font": {"size": 12}},
    )
    line = {"gridcolor": _GRID, "linecolor": _INK, "zerolinecolor": "#999999", "showline": True, "ticks": "outside"}
    figure.update_xaxes(**line)
    figure.update_yaxes(**line, automargin=True, title_standoff=6, exponentformat="power")
    # "<" would let a file's name end the script element that the JSON stands in
    text = figure.to_json(validate=False) or "{}"
    return Drawing(name, text.replace("<", "\\u003c"), alt, caption, height, small)


def thinned(x: Array, *arrays: Array) -> tuple[NDArray[np.floating], ...]:
    """Every n-th row of arrays of equal length, so that at most `MOST_POINTS` are left, in single precision.

    A time counts from its log's start: single precision does not hold a clock that counts since 1970."""
    stride = max(-(-len(x) // MOST_POINTS), 1)
    return tuple(np.asarray(a[::stride], dtype=np.float32) for a in (x, *arrays))


def curve(x: Array, y: Array, name: str, colour: str, legend: bool = True, width: float = 1.4) -> go.Scatter:
    """A line; its legend entry stands for all lines of that name."""
    shown_x, shown_y = thinned(x, y)
    style = {"color": colour, "width": width, "dash": DASH.get(colour, "solid")}
    entry = {"name": name, "legendgroup": name, "showlegend": legend}
    return go.Scatter(x=shown_x, y=shown_y, mode="lines", line=style, **entry)


def band(x: Array, low: Array, high: Array, name: str, colour: str, legend: bool = False) -> go.Scatter:
    """The area between two lines."""
    along, bottom, top = thinned(x, low, high)
    return go.Scatter(
        x=np.concatenate([along, along[::-1]]),
        y=np.concatenate([top, bottom[::-1]]),
        name=name,
        legendgroup=name,
        showlegend=legend,
        mode="lines",
        line={"width": 0},
        fill="toself",
        fillcolor=faded(colour),
        hoverinfo="skip",
    )


def faded(colour: str, opacity: float = 0.2) -> str:
    """A hexadecimal colour made transparent."""
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return f"rgba({red},{green},{blue},{opacity})"
