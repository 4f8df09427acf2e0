"""Where the model fails: smoothed missing torques in time, and their means against each variable."""

from __future__ import annotations

from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from furuta_gym.plant.covariance import NORMAL_95
from identification.diagnosis.locate.location import Where
from identification.diagnosis.locate.torque_maps import ROWS, VARIABLES, Map

from .drawing import AFTER, BEFORE, LAW, MARK, MARKER, Drawing, band, curve, drawing
from .law import Law

_SYMBOLS: dict[str, str] = dict(
    zip(VARIABLES, ("q1 [rad]", "q̇1 [rad/s]", "q2 [rad]", "q̇2 [rad/s]", "u [{u}]", "t [s]"), strict=True)
)
MOST_LOGS = 2
_CLOCK = 1e-6  # s, of two clocks that are one
_ROUNDING = 1e-6  # of the other row's torque: what a law does not act on


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
    start, t = where.torques[log].t[0], where.torques[log].t
    always = any(stop - begin >= 0.99 * (t[-1] - t[0]) for begin, stop in where.intervals_s[log])
    shaded = () if always else where.intervals_s[log]
    reach = 100.0 * least
    for a, row in enumerate(ROWS):
        reach = 0.01 * reach  # a row that lacks nothing has a band of hardly any width: not to be blown up
        for name, side, colour in _sides(where, after):
            torque = side.torques[log]
            m, s = torque.mean[:, a], NORMAL_95 * torque.std[:, a]
            figure.add_trace(band(torque.t - start, m - s, m + s, name, colour), a + 1, 1)
            figure.add_trace(curve(torque.t - start, m, name, colour, legend=a == 0), a + 1, 1)
            inner = slice(len(m) // 50, None)  # the bands are wide where the filter has just begun
            reach = max(reach, float(np.max(np.abs(m[inner]) + s[inner])))
        figure.update_yaxes(title_text=f"{row} [{where.unit}]", range=[-1.05 * reach, 1.05 * reach], row=a + 1)
        for begin, stop in shaded:
            place: dict[str, Any] = {"row": a + 1, "col": 1}  # declared as text, but numbers are meant
            span = {"x0": begin - start, "x1": stop - start}
            figure.add_vrect(**span, fillcolor=MARK, line_width=0, layer="below", **place)
    figure.update_xaxes(title_text="t [s] from the start of the log", row=2)
    source = where.torques[log].source
    remark = " It stands out of its band all along." if always else ""
    remark += " Shaded: where it stands out of its band." if shaded else ""
    return drawing(
        f"torque-{log}",
        figure,
        "Two panels against time: the smoothed torque that the model lacks on the arm's and on the pendulum's row.",
        f"{source}: the torque that each row of the model lacks to explain the log, smoothed, with 95 % bands.{remark} "
        "A complete model gives zero all along.",
        460,
    )


def fitted_law(law: Law, after: Where) -> Drawing:
    """The torque that the effects give against the variable that says most about it, through what the logs ask for.

    A law that follows the time of the run is drawn against time."""
    if law.of_time:
        return _law_in_time(law, after)
    shown = law.best_seen(after.maps)
    figure = _partial(law, shown, after.unit, legend=True)
    text = f"{shown.row}'s row against {shown.variable}"
    return drawing(
        "law",
        figure,
        f"Torque on the {text}: the fitted law as a line through the torque that the log asks for.",
        f"What was added, on the {text}. The line is the fitted law. The points are the torque that the log "
        "needs beyond model (5), with 95 % bars. Points on the line: the law explains it.",
        360,
    )


def _law_in_time(law: Law, after: Where) -> Drawing:
    """The law along the longest stretch, and with the smoothed torque that is left there."""
    row, t = law.row(after.maps), law.signals.t
    figure = go.Figure()
    # of stretches that were chosen from a long log none need be the one of the law
    same = [m for m in after.torques if m.t[0] <= t[0] + _CLOCK and t[-1] <= m.t[-1] + _CLOCK]
    for found in sorted(same, key=lambda m: len(m.t))[-1:]:
        both = np.interp(found.t, t, law.torque[:, row]) + found.mean[:, row]
        width = NORMAL_95 * found.std[:, row]
        figure.add_trace(band(found.t - t[0], both - width, both + width, "asked for by the log", AFTER))
        figure.add_trace(curve(found.t - t[0], both, "asked for by the log", AFTER))
    figure.add_trace(curve(t - t[0], law.torque[:, row], "fitted law", LAW, width=2.0))
    figure.update_xaxes(title_text="t [s] from the start of the log")
    figure.update_yaxes(title_text=f"torque [{after.unit}]")
    text = f"{ROWS[row]}'s row against time"
    return drawing(
        "law",
        figure,
        f"Torque on the {text}: the fitted law as a line over the torque that the log asks for.",
        f"What was added, on the {text}, as it changes during the run. The bold line is the fitted law. The other one "
        "adds what the log needs beyond it, smoothed, with a 95 % band. One on the other: the law explains it.",
        360,
    )


def partials(law: Law, after: Where) -> list[Drawing]:
    """The same against every variable of each row that the law acts on, one small figure each."""
    size = np.sqrt(np.mean(law.torque**2, axis=0))
    acting = [row for a, row in enumerate(ROWS) if size[a] > _ROUNDING * size.max()]
    drawn = []
    for row in acting:
        mine = [m for m in after.maps if m.row == row]
        both = [mean + part.mean for part in mine for _, mean in [law.mean(part)]]
        ends = [side * NORMAL_95 * m.std + b for b, m in zip(both, mine, strict=True) for side in (-1, 1)]
        low, high = min(0.0, *map(np.nanmin, ends)), max(0.0, *map(np.nanmax, ends))
        margin = 0.06 * (high - low)
        for part in mine:
            figure = _partial(law, part, after.unit)
            figure.update_yaxes(range=[low - margin, high + margin])
            text = f"{row}'s row against {part.variable}"
            name = f"law-{row}-{part.variable}".replace(" ", "-")
            alt = f"Torque on the {text}: the fitted law through what the log asks for."
            drawn.append(drawing(name, figure, alt, f"{text[0].upper()}{text[1:]}", 220, small=True))
    return drawn


def _partial(law: Law, shown: Map, unit: str, legend: bool = False) -> go.Figure:
    """Component plus residual: the law's mean in each bin, and the same with the torque that is left."""
    place, mean = law.mean(shown)
    seen = np.isfinite(place)
    place, mean, left, std = place[seen], mean[seen], shown.mean[seen], shown.std[seen]
    figure = go.Figure()
    figure.add_trace(curve(place, mean, "fitted law", LAW, legend=legend, width=2.4))
    bars = {"type": "data", "array": NORMAL_95 * std, "color": AFTER, "thickness": 1.3, "width": 3}
    points = go.Scatter(x=place, y=mean + left, name="asked for by the log", mode="markers", showlegend=legend)
    points.update(marker={"color": AFTER, "symbol": MARKER[AFTER], "size": 9 if legend else 7}, error_y=bars)
    figure.add_trace(points)
    figure.update_xaxes(title_text=_SYMBOLS[shown.variable].format(u=unit))
    figure.update_yaxes(title_text=f"torque [{unit}]")
    return figure


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
    here = after is None and where.found and (where.channel, where.variable) == (found.row, found.variable)
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
