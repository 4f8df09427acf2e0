"""The figures of the trials' report: confusion and power. Imported only when it is written (Plotly is an extra)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
import plotly.graph_objects as go

from experiments.report.drawing import AFTER, BEFORE, MEASURED, Drawing, drawing

from .power import PowerCurve
from .scoring import Outcome
from .summary import ALL


def confusion_figure(table: pd.DataFrame) -> Drawing:
    """Heat map of `summary.confusion`: colours are shares of the row, numbers are trials."""
    counts = table.to_numpy()
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    figure = go.Figure(
        go.Heatmap(
            z=shares,
            x=list(table.columns),
            y=list(table.index),
            text=np.where(counts > 0, counts.astype(str), ""),
            texttemplate="%{text}",
            colorscale=[[0.0, "white"], [1.0, AFTER]],
            zmin=0,
            zmax=1,
            xgap=1,
            ygap=1,
            showscale=False,
            hovertemplate="hidden: %{y}<br>named: %{x}<br>%{text} trials<extra></extra>",
        )
    )
    figure.update_xaxes(title="named first", tickangle=-60, automargin=True, side="bottom", showgrid=False)
    figure.update_yaxes(title="hidden", autorange="reversed", showgrid=False)
    return drawing(
        "confusion",
        figure,
        "Heat map: hidden effects in rows, names given in columns, numbers of trials in the cells.",
        "Numbers are trials, colours their share of the row. Rows in brackets have no name to be found. Answers with "
        "more than one name count by the first; trials with two hidden effects are left out.",
        height=max(420, 200 + 19 * len(table)),
    )


def power_figure(curves: Mapping[str, PowerCurve], outcomes: Sequence[Outcome]) -> Drawing:
    """A curve per effect over the ratios that were tried, and a mark per trial above and below."""
    figure = go.Figure()
    for name, curve in curves.items():
        low, high = (np.log(r - 1.0) for r in curve.tried)
        ratio = 1.0 + np.exp(np.linspace(low, max(high, low + 1e-3), 80))
        figure.add_scatter(
            x=ratio - 1.0,
            y=curve.probability(ratio)[1],
            name=name,
            mode="lines",
            showlegend=name == ALL,
            line={"width": 4, "color": MEASURED} if name == ALL else {"width": 1.2, "color": "#999999"},
            hovertemplate=f"{name}<br>ratio − 1 = %{{x:.3g}}<br>%{{y:.0%}} named right<extra></extra>",
        )
    tried = [o for o in outcomes if o.kind == "library" and o.ratio is not None and o.ratio > 1.0]
    for right, place, colour in ((True, 1.03, AFTER), (False, -0.03, BEFORE)):
        some = [o for o in tried if o.right is right]
        figure.add_scatter(
            x=[(o.ratio or 1.0) - 1.0 for o in some],
            y=[place] * len(some),
            text=[f"{o.subject} on {o.rig}: {o.result}" for o in some],
            mode="markers",
            marker={"symbol": "line-ns-open", "size": 9, "color": colour},
            name="trials named right" if right else "other trials",
            hovertemplate="%{text}<br>ratio − 1 = %{x:.3g}<extra></extra>",
        )
    figure.update_xaxes(title="error-to-noise ratio − 1", type="log")
    figure.update_yaxes(title="named right", tickformat=".0%", range=[-0.07, 1.07])
    return drawing(
        "power",
        figure,
        "Curves: the share of trials named right, alone or in a set of two, against the error-to-noise ratio less one.",
        "Share named right (alone or in a set of two equals) against the error-to-noise ratio, by a logistic curve "
        "with lapses. Black: all effects together. Grey: each effect, over the ratios that were tried. Marks are "
        "single trials. The ratio is √(1 + (e/σ)²): e is the error of model (5) after refitting θ, σ the encoders' "
        "noise.",
        height=560,
    )
