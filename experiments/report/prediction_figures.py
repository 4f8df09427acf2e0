"""Measured over simulated: predictions along a log, the closed loop run again, errors against the horizon."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from furuta_gym.plant.covariance import NORMAL_95
from identification.diagnosis.gap_change import AXES, GapChange, rms_interval
from identification.diagnosis.held_out import readings_at
from identification.logs.log import Log
from identification.validation.gap import Gap
from identification.validation.plots import worst_stretch
from identification.validation.resimulation import Resimulation

from .drawing import AFTER, BEFORE, FLOOR, MARKER, MEASURED, Drawing, band, curve, drawing

_SPAN = 5.0  # s that are shown at first, those with the largest errors


class Side(NamedTuple):
    """A plant's predictions, and how they are drawn."""

    name: str
    gap: Gap
    colour: str


def sides(change: GapChange) -> list[Side]:
    """What there is to compare."""
    return [Side(name, gap, BEFORE if name == "before" else AFTER) for name, gap in change.sides]


def predictions(logs: Sequence[Log], compared: Sequence[Side]) -> Drawing:
    """Readings and predictions of the first log, and their differences with the band that noise explains."""
    one = compared[0].gap
    first = int(one.log[0])  # the first log that was long enough
    floor = np.min([side.gap.floor for side in compared], axis=0)
    log, at = logs[first], one.log == first
    start = float(log.t[0])
    reading, t = readings_at(log, one.times[at]), one.times[at] - start
    shown = worst_stretch(t, compared[0].gap.errors[at] / floor, _SPAN)
    figure = make_subplots(rows=4, cols=1, shared_xaxes=True, vertical_spacing=0.04, row_heights=[3, 2, 3, 2])
    for axis, name in enumerate(AXES):
        row, legend = 2 * axis + 1, axis == 0
        noise = NORMAL_95 * floor[axis]
        size = np.full(2, 1e3 * noise)
        ends = np.array([t[0], t[-1]])
        figure.add_trace(band(ends, -size, size, "noise alone, 95 %", FLOOR, legend=legend), row + 1, 1)
        t_read, angle = log.t - start, log.angles[:, axis]
        near = (t_read >= t[0]) & (t_read <= t[-1])
        figure.add_trace(curve(t_read[near], angle[near], "measured", MEASURED, legend=legend, width=2.2), row, 1)
        for side, gap, colour in compared:
            error = gap.errors[at, axis]
            figure.add_trace(curve(t, reading[:, axis] - error, side, colour, legend=legend), row, 1)
            figure.add_trace(curve(t, 1e3 * error, side, colour, legend=False), row + 1, 1)
        inside = (t >= shown[0]) & (t <= shown[1])
        largest = max(float(np.abs(side.gap.errors[at, axis][inside]).max()) for side in compared)
        reach = 1.1e3 * max(float(noise), largest)
        figure.update_yaxes(title_text=f"{name}<br>[rad]", row=row)
        figure.update_yaxes(title_text=f"error {name[-2:]}<br>[mrad]", range=[-reach, reach], row=row + 1)
    figure.update_xaxes(range=list(shown))
    figure.update_xaxes(title_text="t [s] from the start of the log", row=4)
    both = " and ".join(side.name for side in compared) if len(compared) > 1 else "the plant"
    return drawing(
        "predictions",
        figure,
        f"Four panels against time: measured and predicted {AXES[0]} and {AXES[1]}, each with its prediction error.",
        f"{log.source}: what was measured, and what {both} predicted {one.horizon:g} s before from the filtered state. "
        f"Shown are the {_SPAN:g} s with the largest errors; double-click for the whole log.",
        760,
    )


def closed_loop(runs: tuple[Resimulation, ...], log: Log) -> Drawing:
    """The whole experiment simulated from its start, the log's controller in the loop."""
    names = ("before", "after") if len(runs) > 1 else ("model (5)",)
    colours = (BEFORE, AFTER) if len(runs) > 1 else (AFTER,)
    figure = make_subplots(rows=3, cols=1, shared_xaxes=True, vertical_spacing=0.06)
    measured = (log.q1, log.q2, log.u)
    for panel, label in enumerate((f"{AXES[0]} [rad]", f"{AXES[1]} [rad]", f"command u [{log.input_unit}]")):
        figure.add_trace(
            curve(log.t - log.t[0], measured[panel], "measured", MEASURED, legend=panel == 0), panel + 1, 1
        )
        for name, run, colour in zip(names, runs, colours, strict=True):
            y = run.command if panel == 2 else run.angles[:, panel]
            figure.add_trace(curve(run.t - log.t[0], y, name, colour, legend=panel == 0), panel + 1, 1)
        figure.update_yaxes(title_text=label, row=panel + 1)
    figure.update_xaxes(title_text="t [s] from the start of the log", row=3)
    fits = "; ".join(
        f"{name}: {run.fit_percent[0]:.0f} % of q1, {run.fit_percent[1]:.0f} % of q2"
        + ("" if len(run.t) == len(log) else f" until it fell at {run.t[-1] - log.t[0]:.1f} s")
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


def horizons(compared: Sequence[Side]) -> Drawing:
    """Rms error of each plant at each horizon, beside the floor."""
    figure = make_subplots(rows=1, cols=2, horizontal_spacing=0.16)
    curves = [side.gap.curve for side in compared]
    floor = np.min(curves, axis=0)
    for axis, label in enumerate(AXES):
        drawn = [*floor[:, 3 + axis], *(value for rms in curves for value in rms[:, 1 + axis])]
        for (name, gap, colour), rms in zip(compared, curves, strict=True):
            line = curve(rms[:, 0], 1e3 * rms[:, 1 + axis], name, colour, legend=axis == 0)
            line.update(mode="lines+markers", marker={"symbol": MARKER[colour], "size": 8})
            interval, last = rms_interval(gap), rms[-1, 1 + axis]
            if interval is not None:
                rest = [None] * (len(rms) - 1)  # intervals are known at the last horizon only
                below, above = 1e3 * np.abs(interval[axis] - last)
                drawn += interval[axis].tolist()
                line.update(
                    error_y={"array": [*rest, above], "arrayminus": [*rest, below], "color": colour, "width": 4}
                )
            figure.add_trace(line, 1, axis + 1)
        figure.add_trace(curve(floor[:, 0], 1e3 * floor[:, 3 + axis], "noise floor", FLOOR, axis == 0), 1, axis + 1)
        figure.update_yaxes(**_logarithmic([1e3 * value for value in drawn]), col=axis + 1)
        # below the axis, as beside it a title needs more room than a narrow page has between the panels
        figure.update_xaxes(title_text=f"seconds ahead, {label[-2:]}", rangemode="tozero", col=axis + 1)
    figure.update_yaxes(title_text="error [mrad]", col=1)
    return drawing(
        "horizons",
        figure,
        "The root mean square prediction error of both angles at each horizon, beside the noise floor.",
        "Prediction error (logarithmic) against how far ahead the plant predicts. The whiskers at the last horizon are "
        "95 % intervals over stretches of one second. A perfect plant reaches the noise floor.",
        340,
    )


def _logarithmic(drawn: Sequence[float]) -> dict[str, Any]:
    """An axis from a tick below what is drawn to a tick above, each with its number: Plotly writes 2 and 5 for 20 and
    50."""
    positive = [value for value in drawn if value > 0]
    if not positive:
        return {"type": "log"}
    lowest, highest = min(positive), max(positive)
    decades = range(math.floor(math.log10(lowest)) - 1, math.ceil(math.log10(highest)) + 2)
    digits = (1, 2, 5) if len(decades) < 8 else (1,)
    ticks = [float(f"{digit}e{decade}") for decade in decades for digit in digits]
    first, last = max(t for t in ticks if t < lowest), min(t for t in ticks if t > highest)
    shown = [t for t in ticks if first <= t <= last]
    ends = [math.log10(first), math.log10(last * (last / first) ** 0.04)]  # the legend stands above
    return {"type": "log", "range": ends, "tickvals": shown, "ticktext": [f"{t:g}" for t in shown]}


def residuals(gap: Gap) -> Drawing:
    """Correlation of the first stretch's innovations with their own past, with the band of white ones."""
    test = gap.tests[0]
    lag = 1e3 * test.lag_s * np.arange(1, len(test.correlation) + 1)
    figure = make_subplots(rows=1, cols=2, shared_yaxes=True, horizontal_spacing=0.06)
    ends = np.array([0.0, lag[-1] + lag[0]])
    size = np.full(2, test.band)
    for axis, label in enumerate(AXES):
        figure.add_trace(band(ends, -size, size, "white noise, 95 %", FLOOR, legend=axis == 0), 1, axis + 1)
        bars = go.Bar(
            x=lag,
            y=test.correlation[:, axis],
            name="measured",
            showlegend=axis == 0,
            marker={"color": AFTER},
            hovertemplate="%{x:.3g} ms: %{y:.3f}",
        )
        figure.add_trace(bars, 1, axis + 1)
        figure.update_xaxes(title_text=f"lag of {label[-2:]} [ms]", col=axis + 1)
    reach = 1.15 * max(float(np.abs(test.correlation).max()), 2 * test.band)
    figure.update_yaxes(range=[-reach, reach])
    figure.update_yaxes(title_text="correlation", col=1)
    return drawing(
        "residuals",
        figure,
        "Correlations of one-step prediction errors with earlier ones, for both angles.",
        "Correlation of one-step prediction errors with earlier ones. With a complete model the bars stay within the "
        "band; rounding may lift them a little above it.",
        300,
    )
