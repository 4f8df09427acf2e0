"""What the search compared: the suspects of each step, and the parameters before and after."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go

from identification.diagnosis.naming.forward import Naming
from identification.estimation.estimate import Estimate

from .drawing import AFTER, BEFORE, NORMAL_95, Drawing, drawing, pattern

_OTHER = "#999999"
_MOST = 8


def rankings(naming: Naming) -> list[Drawing]:
    """Suspects of each step by what they gain; the accepted one and its equals stand out."""
    return [_ranking(naming, step) for step in range(len(naming.rankings)) if naming.rankings[step]]


def _ranking(naming: Naming, step: int) -> Drawing:
    shown = naming.rankings[step][:_MOST]
    accepted = {s.name for s in naming.accepted}
    equals = set(naming.equals[step]) if step < len(naming.accepted) else set()
    labels = {s.name: f"{s.name}  {s.net:+.0f}" for s in shown}
    figure = go.Figure()
    for label, colour, shape, chosen in (
        ("added", AFTER, "", [s for s in shown if s.name in accepted]),
        ("cannot be told from it", BEFORE, "/", [s for s in shown if s.name in equals - accepted]),
        ("others", _OTHER, "", [s for s in shown if s.name not in equals | accepted]),
    ):
        bars = go.Bar(
            x=[s.net for s in chosen],
            y=[labels[s.name] for s in chosen],
            name=label,
            orientation="h",
            marker={"color": colour, "pattern": pattern(shape)},
            hovertemplate="%{y} nats<extra></extra>",
        )
        if chosen:
            figure.add_trace(bars)
    order = [labels[s.name] for s in reversed(shown)]
    figure.update_yaxes(categoryorder="array", categoryarray=order)
    figure.update_xaxes(title_text="net gain [nats]")
    figure.update_layout(bargap=0.35, barmode="overlay", showlegend=True)
    best = ", ".join(f"{s.name} {s.net:+.0f}" for s in shown[:3])
    return drawing(
        f"ranking-{step + 1}",
        figure,
        f"Horizontal bars of the nats that each suspect gains in step {step + 1}: {best}.",
        f"Step {step + 1}: each suspect was fitted together with all other parameters and the noise. "
        "Bars: the log-likelihood that it gains, less the price of its own parameters.",
        120 + 30 * len(shown),
    )


def parameters(before: Estimate, after: Estimate) -> Drawing:
    """Relative change of the parameters of model (5), with 95 % bars of both estimates."""
    names = [n for n in before.names if n in after.names and before.value(n)]
    shown = [name.replace("theta", "θ") for name in names]
    figure = go.Figure()
    for label, estimate, colour, symbol in (
        ("before", before, BEFORE, "circle-open"),
        ("after", after, AFTER, "diamond"),
    ):
        base = np.array([before.value(n) for n in names])
        value = np.array([estimate.value(n) for n in names])
        std = np.array([estimate.std[estimate.names.index(n)] for n in names])
        bars = {"type": "data", "array": 100 * NORMAL_95 * std / np.abs(base), "color": colour, "thickness": 1.4}
        figure.add_trace(
            go.Scatter(
                x=100 * (value - base) / np.abs(base), y=shown, error_x=bars, name=label, mode="markers",
                marker={"color": colour, "symbol": symbol, "size": 9},
            )
        )  # fmt: skip
    figure.update_yaxes(categoryorder="array", categoryarray=shown[::-1])
    figure.update_xaxes(title_text="change [%]")
    return drawing(
        "parameters",
        figure,
        "Relative change of each parameter when the effects are added, with 95 % bars.",
        "The parameters of model (5) without and with the effects, relative to the value without, with 95 % bars. "
        "What moves by more than its bars was biased by the missing effect.",
        100 + 32 * len(names),
    )
