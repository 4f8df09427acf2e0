"""Where the model fails: smoothed missing torques in time, and their means against each variable."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from identification.diagnosis.locate.location import Where
from identification.diagnosis.locate.torque_maps import ROWS, VARIABLES, Map

from .drawing import AFTER, BEFORE, MARK, MARKER, NORMAL_95, Drawing, band, curve, drawing

_SYMBOLS: dict[str, str] = dict(
    zip(VARIABLES, ("q1 [rad]", "q̇1 [rad/s]", "q2 [rad]", "q̇2 [rad/s]", "u [{u}]", "t [s]"), strict=True)
)
MOST_LOGS = 3


def _sides(where: Where, after: Where | None) -> list[tuple[str, Where, str]]:
    """(name, where, colour) of what is to be compared."""
    if after is None:
        return [("model (5)", where, AFTER)]
    return [("before", where, BEFORE), ("after", after, AFTER)]


def torques(where: Where, after: Where | None, least: float) -> list[Drawing]:
    """One figure for each log, the first few. least [{u}]: what the arm's axis reaches at least."""
    return [_torque(where, after, i, least) for i in range(min(len(where.torques), MOST_LOGS))]


def _torque(where: Where, after: Where | None, log: int, least: float) -> Drawing:
    figure = make_subplots(rows=2, cols=1, shared_xaxes=True, vertical_spacing=0.06)
    t = where.torques[log].t
    always = any(stop - start >= 0.99 * (t[-1] - t[0]) for start, stop in where.intervals_s[log])
    shaded = () if always else where.intervals_s[log]
    reach = 100.0 * least
    for a, row in enumerate(ROWS):
        reach = 0.01 * reach  # a row that lacks nothing has a band of hardly any width: not to be blown up
        for name, side, colour in _sides(where, after):
            torque = side.torques[log]
            m, s = torque.mean[:, a], NORMAL_95 * torque.std[:, a]
            figure.add_trace(band(torque.t, m - s, m + s, name, colour), a + 1, 1)
            figure.add_trace(curve(torque.t, m, name, colour, legend=a == 0), a + 1, 1)
            inner = slice(len(m) // 50, None)  # the bands are wide where the filter has just begun
            reach = max(reach, float(np.max(np.abs(m[inner]) + s[inner])))
        figure.update_yaxes(title_text=f"on the {row} [{where.unit}]", range=[-1.05 * reach, 1.05 * reach], row=a + 1)
        for start, stop in shaded:
            figure.add_vrect(x0=start, x1=stop, fillcolor=MARK, line_width=0, layer="below", row=a + 1, col=1)  # type: ignore[arg-type]
    figure.update_xaxes(title_text="t [s]", row=2)
    source = where.torques[log].source
    remark = " It stands out of its band all along." if always else ""
    remark += " Shaded: where it stands out of its band." if shaded else ""
    return drawing(
        f"torque-{log}",
        figure,
        "Two panels against time: the smoothed torque that the model lacks on the arm's and on the pendulum's row.",
        f"{source}: the torque that would have to be added to each row of the model to explain the log, smoothed, with "
        f"95 % bands.{remark} Zero all along is what a complete model gives.",
        520,
    )


def maps(where: Where, after: Where | None) -> list[Drawing]:
    """Mean missing torque against each variable, one small figure each, arm first."""
    drawn = []
    for row in ROWS:
        every = [m for _, side, _ in _sides(where, after) for m in side.maps if m.row == row]
        reach = 1.05 * max(float(np.max(np.abs(m.mean) + NORMAL_95 * m.std)) for m in every)
        for found in (m for m in where.maps if m.row == row):
            drawn.append(_map(found, where, after, reach))
    return drawn


def _map(found: Map, where: Where, after: Where | None, reach: float) -> Drawing:
    figure = go.Figure()
    for name, side, colour in _sides(where, after):
        m = next(m for m in side.maps if (m.row, m.variable) == (found.row, found.variable))
        centre = 0.5 * (m.edges[1:] + m.edges[:-1])
        figure.add_trace(
            go.Scatter(
                x=centre, y=m.mean, name=name, mode="markers", showlegend=False,
                marker={"color": colour, "symbol": MARKER[colour], "size": 7},
                error_y={"type": "data", "array": NORMAL_95 * m.std, "color": colour, "thickness": 1.2, "width": 2},
            )
        )  # fmt: skip
    figure.update_xaxes(title_text=_SYMBOLS[found.variable].format(u=where.unit))
    figure.update_yaxes(title_text=f"torque [{where.unit}]", range=[-reach, reach])
    here = where.found and (where.channel, where.variable) == (found.row, found.variable)
    if here:
        figure.update_layout(plot_bgcolor=MARK)
    text = f"{found.row}'s row against {found.variable}"
    return drawing(
        f"map-{found.row}-{found.variable}".replace(" ", "-"),
        figure,
        f"Mean missing torque on the {text}, with 95 % bars.",
        f"{text[0].upper()}{text[1:]}" + (" ← here" if here else ""),
        220,
        small=True,
    )
