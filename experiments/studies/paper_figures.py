"""Figures 2, 3 and 4 of the paper, from a run of `experiments.studies.reproduce_paper`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from furuta_gym.files import whole_file
from furuta_gym.plant import TABLE_3
from furuta_gym.plant.parameters import THETA_MEANING

from .paper_results import Results

_COLOURS = ("#0072b2", "#e69f00", "#d55e00")  # by λ
_EXPERIMENT, _LS, _PE = "0.45", "#0072b2", "#009e73"
_ZOOM = 4.0  # s at the end of the run


def draw_figures(results: Results, out: Path) -> list[Path]:
    """Write figure2.png, figure3.png and figure4.png into `out`; returns their paths."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    paths = []
    for name, size, draw in (
        ("figure2.png", (12.5, 9.0), _parameters),
        ("figure3.png", (12.5, 7.0), _command),
        ("figure4.png", (12.5, 9.5), _angles),
    ):
        figure = Figure(figsize=size, layout="constrained", dpi=100)
        FigureCanvasAgg(figure)
        draw(figure, results)
        path = out / name
        with whole_file(path) as new:
            figure.savefig(new)
        paths.append(path)
    return paths


def _parameters(figure: Any, results: Results) -> None:
    """θ̂(t) of Eq. (2) in nine panels; the y range is what the run's second half, Table 3 and zero need."""
    a = results.arguments
    axes = figure.subplots(3, 3, sharex=True)
    pe = results.fits["PE"]
    for i, ax in enumerate(axes.flat):
        name = f"theta{i + 1}"
        shown = [0.0, TABLE_3.theta[i]]
        lines = [(f"LS, λ = {lam:g}", c, 1.6) for lam, c in zip(a.lambdas, _COLOURS, strict=False)]
        for key, colour, width in [*lines, (f"LS, exact readings, λ = {a.lambdas[0]:g}", "0.55", 1.2)]:
            history = results.histories[key]
            ax.plot(history.t, history.theta[:, i], color=colour, lw=width, label=f"{key} 1/s")
            shown += list(history.theta[history.t > 0.5 * a.duration, i])
        ax.axhline(TABLE_3.theta[i], color="k", ls="--", lw=1.2, label="Table 3 (the truth here)")
        ax.errorbar(
            [a.duration],
            [pe.theta[i]],
            [2 * pe.std[i]],
            fmt="o",
            ms=5,
            color=_PE,
            capsize=3,
            label="PE ± 2 sd",
            zorder=5,
        )
        low, high = np.nanmin(shown), np.nanmax(shown)
        ax.set_ylim(low - 0.15 * (high - low), high + 0.15 * (high - low))
        ax.axhline(0.0, color="0.85", lw=0.8, zorder=0)
        ax.set_title(f"θ{i + 1}", fontsize=11, loc="left")
        ax.set_ylabel(THETA_MEANING[name][1].format(u=TABLE_3.unit))
        ax.set_xlim(0, 1.02 * a.duration)
    for ax in axes[-1]:
        ax.set_xlabel("t [s]")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
    figure.suptitle(
        f"Figure 2. Parameters θ̂(t) by filtered least squares, Eq. (2), T = {1e3 * a.T:g} ms, "
        f"{a.encoder_counts:g}-count encoders"
    )


def _pairs(results: Results) -> list[tuple[str, str]]:
    """The simulations with estimates and their colours."""
    return [(name, _PE if name == "PE" else _LS) for name in results.simulations if name in results.fits]


def _command(figure: Any, results: Results) -> None:
    """τ(t) of the experiment and of each simulation: a row each, the whole run and its end."""
    pairs = _pairs(results)
    axes = figure.subplots(len(pairs), 2, sharey=True, squeeze=False, width_ratios=(2, 1))
    end = results.arguments.duration
    zoom = min(_ZOOM, 0.5 * end)
    for row, (name, colour) in zip(axes, pairs, strict=True):
        run = results.simulations[name]
        for ax in row:
            ax.plot(results.experiment.t, results.experiment.command, color=_EXPERIMENT, lw=1.6, label="experiment")
            ax.plot(run.t, run.command, color=colour, lw=1.2, label=f"simulation with {name}")
            _mark_fall(ax, results, name)
        row[0].set_xlim(0, end)
        row[1].set_xlim(end - zoom, end)
        row[0].set_ylabel("τ [V]")
        row[0].set_title(_title(results, name), fontsize=11, loc="left")
        row[1].set_title(f"the last {zoom:g} s", fontsize=11, loc="left")
    _finish(axes, "Figure 3. Command τ(t)", figure)


def _angles(figure: Any, results: Results) -> None:
    """q1(t) and q2(t) of the experiment and of each simulation, and their difference."""
    pairs = _pairs(results)
    axes = figure.subplots(2 * len(pairs), 2, sharex=True, squeeze=False, width_ratios=(2, 1))
    truth = results.experiment
    for k, (name, colour) in enumerate(pairs):
        run = results.simulations[name]
        n = min(len(run), len(truth))
        for j, label in enumerate(("q1, arm", "q2, pendulum")):
            left, right = axes[2 * k + j]
            left.plot(truth.t, truth.state[:, j], color="0.75", lw=4.0, label="experiment")
            left.plot(run.t, run.state[:, j], color=colour, lw=1.2, label=f"simulation with {name}")
            right.plot(run.t[:n], 1e3 * (run.state[:n, j] - truth.state[:n, j]), color=colour, lw=0.9)
            right.axhline(0.0, color="0.75", lw=0.8, zorder=0)
            left.set_ylabel(f"{label} [rad]")
            right.set_ylabel("[mrad]")
            _mark_fall(left, results, name)
        axes[2 * k][0].set_title(_title(results, name), fontsize=11, loc="left")
        axes[2 * k][1].set_title("simulation − experiment", fontsize=11, loc="left")
    for j in (0, 1):  # one scale for the differences of each angle
        low, high = zip(*(axes[2 * k + j][1].get_ylim() for k in range(len(pairs))), strict=True)
        for k in range(len(pairs)):
            axes[2 * k + j][1].set_ylim(min(low), max(high))
    axes[0][0].set_xlim(0, results.arguments.duration)
    _finish(axes, "Figure 4. Arm position q1(t) and pendulum position q2(t)", figure)


def _mark_fall(ax: Any, results: Results, name: str) -> None:
    if (fell := results.simulations[name].fell) is not None:
        ax.axvline(fell, color="#d55e00", lw=1.5, label=f"simulation with {name} falls at {fell:.2f} s")


def _title(results: Results, name: str) -> str:
    m = results.misfit(name)
    return (
        f"Model (5) with {name}: rms difference {1e3 * m['q1_rad']:.1f} mrad (q1), "
        f"{1e3 * m['q2_rad']:.1f} mrad (q2), {m['tau_V']:.2f} V (τ)"
    )


def _finish(axes: Any, title: str, figure: Any) -> None:
    """Time axes, and one legend below for all panels."""
    for ax in axes[-1]:
        ax.set_xlabel("t [s]")
    entries = {}
    for ax in axes[:, 0]:
        entries |= {label: handle for handle, label in zip(*ax.get_legend_handles_labels(), strict=True)}
    figure.legend(entries.values(), entries.keys(), loc="outside lower center", ncols=4, frameon=False)
    figure.suptitle(f"{title}: experiment (plant of Table 3, encoders) and simulation with the estimates")
