"""Pictures of where a model fails: the missing torques in time, and against each variable."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .maps import ROWS, VARIABLES
from .where import Where

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_UNITS: dict[str, str] = dict(zip(VARIABLES, ("rad", "rad/s", "rad", "rad/s", "", "s"), strict=True))


def plot_torques(where: Where, log: int = 0) -> Figure:
    """Smoothed missing torques of one log with 95 % bands; stretches in which they stand out are shaded."""
    from matplotlib.figure import Figure

    torque = where.torques[log]
    figure = Figure(figsize=(9, 5), layout="constrained")
    figure.suptitle(torque.source, fontsize=10)
    axes = figure.subplots(2, 1, sharex=True)
    for a, axis in enumerate(axes):
        for start, stop in where.intervals_s[log]:
            axis.axvspan(start, stop, color="tab:orange", alpha=0.15, lw=0)
        low, high = torque.mean[:, a] - 1.96 * torque.std[:, a], torque.mean[:, a] + 1.96 * torque.std[:, a]
        axis.fill_between(torque.t, low, high, color="tab:blue", alpha=0.3, lw=0, label="95 %")
        axis.plot(torque.t, torque.mean[:, a], color="tab:blue", lw=0.9)
        axis.axhline(0.0, color="0.5", lw=0.6)
        axis.set_ylabel(f"missing on the {ROWS[a]} [{where.unit}]")
        axis.set_title(f"R² {where.predictable[a]:.2f}, largest line {where.line[a]:.2f}", fontsize=9)
    axes[0].legend(loc="upper right", fontsize=8)
    axes[1].set_xlabel("t [s]")
    return figure


def plot_maps(where: Where) -> Figure:
    """Mean missing torque against each variable, with 95 % bands, for both rows."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(14, 5), layout="constrained")
    axes = figure.subplots(2, len(VARIABLES))
    for m in where.maps:
        row = ROWS.index(m.row)
        axis = axes[row, VARIABLES.index(m.variable)]
        centre = 0.5 * (m.edges[1:] + m.edges[:-1])
        axis.errorbar(centre, m.mean, yerr=1.96 * m.std, fmt="o", ms=3, lw=1.0, color="tab:blue")
        axis.axhline(0.0, color="0.5", lw=0.6)
        if (where.channel, where.variable) == (m.row, m.variable):
            axis.set_facecolor("#fff3e0")
        unit = _UNITS[m.variable] or where.unit
        axis.set_xlabel(f"{m.variable} [{unit}]", fontsize=8)
        axis.tick_params(labelsize=7)
        if m.variable == VARIABLES[0]:
            axis.set_ylabel(f"missing on the {m.row} [{where.unit}]", fontsize=8)
    axes[1, VARIABLES.index("command")].set_visible(False)
    # both rows on scales of their own, shared within a row
    for row in axes:
        used = [axis for axis in row if axis.get_visible()]
        reach = 1.1 * max(float(np.abs(axis.get_ylim()).max()) for axis in used)
        for axis in used:
            axis.set_ylim(-reach, reach)
    return figure
