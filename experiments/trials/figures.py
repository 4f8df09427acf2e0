"""The figures of the report: confusion and power. Imported only when a report is written (Plotly is an extra)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
import plotly.graph_objects as go

from .power import PowerCurve
from .scoring import Outcome


def confusion_figure(table: pd.DataFrame) -> go.Figure:
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
            colorscale="Blues",
            zmin=0,
            zmax=1,
            colorbar={"title": "share of row"},
            hovertemplate="hidden %{y}<br>named %{x}<br>%{text} trials<extra></extra>",
        )
    )
    figure.update_layout(
        title="What was hidden, and what was named first",
        height=240 + 20 * len(table),
        xaxis={"title": "named first", "tickangle": -60, "automargin": True},
        yaxis={"title": "hidden", "autorange": "reversed", "automargin": True},
        template="plotly_white",
    )
    return figure


def power_figure(curves: Mapping[str, PowerCurve], outcomes: Sequence[Outcome]) -> go.Figure:
    """A curve per effect over the ratios that were tried, and a mark per trial above and below."""
    figure = go.Figure()
    for name, curve in curves.items():
        low, high = (np.log(r - 1.0) for r in curve.tried)
        ratio = 1.0 + np.exp(np.linspace(low, max(high, low + 1e-3), 80))
        whole = name == "all effects"
        figure.add_scatter(
            x=ratio - 1.0,
            y=curve.probability(ratio),
            name=name,
            mode="lines",
            line={"width": 4, "color": "black"} if whole else {"width": 1.5},
            hovertemplate=f"{name}<br>ratio − 1 = %{{x:.3g}}<br>%{{y:.0%}} named right<extra></extra>",
        )
    tried = [o for o in outcomes if o.kind == "library" and o.ratio is not None and o.ratio > 1.0]
    for right, place in ((True, 1.03), (False, -0.03)):
        figure.add_scatter(
            x=[(o.ratio or 1.0) - 1.0 for o in tried if o.right is right],
            y=[place for o in tried if o.right is right],
            text=[f"{o.subject} on {o.rig}: {o.result}" for o in tried if o.right is right],
            mode="markers",
            marker={"symbol": "line-ns-open", "size": 8},
            name="trials named right" if right else "other trials",
        )
    figure.update_layout(
        title="Share named right (alone or within a set of two) against the size of the gap",
        xaxis={"title": "gap ratio − 1 (held-out error over its noise floor, less 1)", "type": "log"},
        yaxis={"title": "named right", "tickformat": ".0%", "range": [-0.06, 1.06]},
        height=620,
        template="plotly_white",
    )
    return figure
