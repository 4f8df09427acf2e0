"""Measured over simulated: predictions along a log, the closed loop run again, errors against the horizon."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from identification.diagnosis.gap_change import AXES, GapChange, rms_interval
from identification.diagnosis.verify import readings_at
from identification.logs.log import Log
from identification.validation.gap import Gap
from identification.validation.resimulation import Resimulation

from .drawing import AFTER, BEFORE, FLOOR, MEASURED, NORMAL_95, Array, Drawing, band, curve, drawing, pattern

_SPAN = 5.0  # s that are shown at first, those with the largest errors


def _coloured(change: GapChange) -> list[tuple[str, Gap, str]]:
    """(name, gap, colour) of what is to be compared."""
    return [(name, gap, BEFORE if name == "before" else AFTER) for name, gap in change.sides]


def predictions(change: GapChange) -> Drawing:
    """Readings and predictions of the first log, and their differences with the band that noise explains."""
    first = int(change.before.log[0])  # the first log that was long enough
    log, at = change.logs[first], change.before.log == first
    t = change.before.times[at]
    reading = readings_at(log, t)
    horizon = change.before.horizon
    shown = _worst(t, change.before.errors[at] / change.floor)
    figure = make_subplots(rows=4, cols=1, shared_xaxes=True, vertical_spacing=0.04)
    for axis, name in enumerate(AXES):
        row, legend = 2 * axis + 1, axis == 0
        noise = NORMAL_95 * change.floor[axis]
        size = np.full(len(t), 1e3 * noise)
        figure.add_trace(band(t, -size, size, "noise alone, 95 %", FLOOR, legend=legend), row + 1, 1)
        t_read, angle = log.t, log.angles[:, axis]
        near = (t_read >= t[0]) & (t_read <= t[-1])
        figure.add_trace(curve(t_read[near], angle[near], "measured", MEASURED, legend=legend), row, 1)
        for side, gap, colour in _coloured(change):
            error = gap.errors[at, axis]
            predicted = reading[:, axis] - error
            figure.add_trace(band(t, predicted - noise, predicted + noise, side, colour), row, 1)
            figure.add_trace(curve(t, predicted, side, colour, legend=legend), row, 1)
            figure.add_trace(curve(t, 1e3 * error, side, colour, legend=False), row + 1, 1)
        inside = (t >= shown[0]) & (t <= shown[1])
        largest = max(float(np.abs(gap.errors[at, axis][inside]).max()) for _, gap, _ in _coloured(change))
        reach = 1.1e3 * max(float(noise), largest)
        figure.update_yaxes(title_text=f"{name} [rad]", row=row)
        figure.update_yaxes(title_text=f"error of {name[-2:]} [mrad]", range=[-reach, reach], row=row + 1)
    figure.update_xaxes(range=list(shown))
    figure.update_xaxes(title_text="t [s]", row=4)
    compared = " and ".join(side for side, _ in change.sides)
    return drawing(
        "predictions",
        figure,
        f"Four panels against time: measured and predicted {AXES[0]} and {AXES[1]}, each with its prediction error.",
        f"{log.source}: what was measured, and what the plant ({compared}) predicted {horizon:g} s before from the "
        f"filtered state; around predictions the 95 % band of the noise. Shown are the {_SPAN:g} s with the largest "
        "errors; double-click for the whole log.",
        860,
    )


def _worst(t: Array, error: Array) -> tuple[float, float]:
    """The stretch of `_SPAN` seconds with the largest errors."""
    badness = np.concatenate([[0.0], np.cumsum(np.sum(error**2, axis=1))])
    stop = np.searchsorted(t, t + _SPAN)
    start = float(t[int(np.argmax(badness[stop] - badness[np.arange(len(t))]))])
    start = max(min(start, float(t[-1]) - _SPAN), float(t[0]))
    return start, min(start + _SPAN, float(t[-1]))


def closed_loop(runs: tuple[Resimulation, ...], log: Log) -> Drawing:
    """The whole experiment simulated from its start, the log's controller in the loop."""
    names = ("before", "after") if len(runs) > 1 else ("model (5)",)
    colours = (BEFORE, AFTER) if len(runs) > 1 else (AFTER,)
    figure = make_subplots(rows=3, cols=1, shared_xaxes=True, vertical_spacing=0.06)
    measured = (log.q1, log.q2, log.u)
    for panel, label in enumerate((f"{AXES[0]} [rad]", f"{AXES[1]} [rad]", f"command u [{log.input_unit}]")):
        figure.add_trace(curve(log.t, measured[panel], "measured", MEASURED, legend=panel == 0), panel + 1, 1)
        for name, run, colour in zip(names, runs, colours, strict=True):
            y = run.command if panel == 2 else run.angles[:, panel]
            figure.add_trace(curve(run.t, y, name, colour, legend=panel == 0), panel + 1, 1)
        figure.update_yaxes(title_text=label, row=panel + 1)
    figure.update_xaxes(title_text="t [s]", row=3)
    fits = "; ".join(
        f"{name}: {run.fit_percent[0]:.0f} % of q1, {run.fit_percent[1]:.0f} % of q2"
        + ("" if len(run.t) == len(log) else f" until it fell at {run.t[-1]:.1f} s")
        for name, run in zip(names, runs, strict=True)
    )
    return drawing(
        "closed-loop",
        figure,
        "Three panels against time: arm, pendulum and command, measured and simulated in closed loop.",
        f"{log.source} simulated in closed loop from its first sample. Fit: {fits}. A picture, not a measure: feedback "
        "hides most errors.",
        640,
    )


def horizons(change: GapChange) -> Drawing:
    """Rms error at each horizon, before and after, beside the floor."""
    figure = make_subplots(rows=1, cols=2, horizontal_spacing=0.2)
    floor = np.minimum(change.before.curve, change.after.curve)
    labels = [f"{h:.2g} s" for h in floor[:, 0]]
    rest = [None] * (len(labels) - 1)  # intervals are known at the last horizon only

    def bars(axis: int, rms: Array, name: str, colour: str, stroke: str, whisker: dict | None = None) -> None:
        bar = go.Bar(
            x=labels,
            y=rms,
            name=name,
            legendgroup=name,
            showlegend=axis == 0,
            error_y=whisker,
            marker={"color": colour, "pattern": pattern(stroke)},
            hovertemplate="%{y:.3g} mrad",
        )
        figure.add_trace(bar, 1, axis + 1)

    for axis, label in enumerate(AXES):
        for name, gap, colour in _coloured(change):
            rms = 1e3 * gap.curve[:, 1 + axis]
            low, high = 1e3 * rms_interval(gap)[axis]
            ends = {"array": [*rest, high - rms[-1]], "arrayminus": [*rest, rms[-1] - low]}
            bars(axis, rms, name, colour, "/" if colour == BEFORE else "", {"color": MEASURED, "width": 0, **ends})
        bars(axis, 1e3 * floor[:, 3 + axis], "noise floor", FLOOR, ".")
        figure.update_yaxes(title_text=f"error of {label[-2:]} [mrad]", col=axis + 1)
    figure.update_layout(barmode="group")
    figure.update_xaxes(title_text="horizon")
    return drawing(
        "horizons",
        figure,
        "Bars of the root mean square prediction error of both angles at each horizon, beside the noise floor.",
        "Prediction error against how far ahead the plant predicts. The whiskers at the last horizon are 95 % "
        "intervals over stretches of one second. A perfect plant reaches the noise floor.",
        380,
    )
