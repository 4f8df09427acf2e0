"""Pictures of a validation: predictions over the measurement, errors against the horizon, innovations."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..logs.log import Log
from .gap import Gap

Array = NDArray[np.float64]

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SPAN = 5.0  # s
_NAMES = ("arm q1", "pendulum q2")
_MEASURED, _PREDICTED, _FLOOR = "0.25", "tab:orange", "tab:blue"


def plot_predictions(gap: Gap, logs: Log | Sequence[Log]) -> Figure:
    """Readings of the first log that was long enough, each window's prediction for its end, and the ± 2 floor band
    around the predictions: over the seconds with the largest errors.
    """
    from matplotlib.figure import Figure

    log = int(gap.log[0])
    source = logs if isinstance(logs, Log) else logs[log]
    mine = gap.log == log
    t, error = gap.times[mine], gap.errors[mine]
    start, stop = worst_stretch(t, error / gap.floor, _SPAN)
    shown, inside = (t >= start) & (t <= stop), (source.t >= start) & (source.t <= stop)
    figure = Figure(figsize=(9, 6), layout="constrained")
    axes = figure.subplots(2, 1, sharex=True)
    for a, axis in enumerate(axes):
        angle = (source.q1, source.q2)[a]
        predicted = np.interp(t, source.t, angle)[shown] - error[shown, a]
        band = 2.0 * gap.floor[a]
        axis.fill_between(
            t[shown], predicted - band, predicted + band, color=_FLOOR, alpha=0.3, lw=0, label="± 2 noise floor"
        )
        axis.plot(source.t[inside], angle[inside], color=_MEASURED, lw=1.0, label="measured")
        axis.plot(
            t[shown], predicted, ".", ms=3, color=_PREDICTED, label=f"predicted {1e3 * gap.horizon:.0f} ms before"
        )
        axis.set_ylabel(f"{_NAMES[a]} [rad]")
        axis.set_title(f"rms {gap.rms[a] / gap.floor[a]:.2f} × floor, fit {gap.fits[a]} %", fontsize=9)
    axes[0].legend(loc="upper right", fontsize=8)
    axes[1].set_xlabel("t [s]")
    return figure


def worst_stretch(t: Array, error: Array, span: float) -> tuple[float, float]:
    """Where `span` seconds with the largest errors (M, 2) at times t (M,) begin and end [s]."""
    badness = np.concatenate([[0.0], np.cumsum(np.sum(error**2, axis=1))])
    stop = np.searchsorted(t, t + span)
    start = float(t[int(np.argmax(badness[stop] - badness[np.arange(len(t))]))])
    start = max(min(start, float(t[-1]) - span), float(t[0]))
    return start, min(start + span, float(t[-1]))


def plot_horizons(gaps: dict[str, Gap]) -> Figure:
    """Rms error against the horizon for one plant or several (by name), over the lowest floor of them."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 3.6), layout="constrained")
    for a, axis in enumerate(figure.subplots(1, 2)):
        for name, gap in gaps.items():
            axis.plot(gap.curve[:, 0], 1e3 * gap.curve[:, 1 + a], "o-", label=name)
        horizon = next(iter(gaps.values())).curve[:, 0]
        floor = np.min([gap.curve[:, 3 + a] for gap in gaps.values()], axis=0)
        axis.plot(horizon, 1e3 * floor, "k--", label="noise floor")
        axis.set(xlabel="horizon [s]", ylabel=f"rms error of {_NAMES[a]} [mrad]", yscale="log")
    figure.axes[0].legend(fontsize=8)
    return figure


def plot_innovations(gap: Gap) -> Figure:
    """Correlations of the first stretch's innovations with their past and with the command's, with the 95 % band of
    white ones."""
    from matplotlib.figure import Figure

    test = gap.tests[0]
    lag = 1e3 * test.lag_s * np.arange(1, len(test.correlation) + 1)
    figure = Figure(figsize=(9, 5), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True, sharey=True)
    rows = (
        ("with the past innovation", test.correlation, test.p_white),
        ("with the past command", test.command_correlation, test.p_command),
    )
    for row, (name, values, p) in zip(axes, rows, strict=True):
        for a, axis in enumerate(row):
            axis.axhspan(-test.band, test.band, color=_FLOOR, alpha=0.25, lw=0)
            axis.bar(lag, values[:, a], width=0.7 * (lag[1] - lag[0]), color=_MEASURED)
            axis.set_title(f"{_NAMES[a]}, {name} (p = {p[a]:.2g})", fontsize=9)
    for axis in axes[1]:
        axis.set_xlabel("lag [ms]")
    return figure
