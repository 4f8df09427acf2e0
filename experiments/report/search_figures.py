"""What the search compared: the suspects of each step, and the parameters before and after."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go

from furuta_gym.plant import EFFECTS
from furuta_gym.plant.covariance import NORMAL_95
from identification.diagnosis.naming.forward import Naming
from identification.estimation.estimate import Estimate

from .contents import Bar, Bars
from .drawing import AFTER, BEFORE, Drawing, drawing

_MOST = 8


def rankings(naming: Naming) -> list[Bars]:
    """Suspects of each step by what they gain; the accepted one and its equals stand out."""
    return [_ranking(naming, step) for step in range(len(naming.rankings)) if naming.rankings[step]]


def _ranking(naming: Naming, step: int) -> Bars:
    shown = naming.rankings[step][:_MOST]
    accepted = {s.name for s in naming.accepted}
    equals = set(naming.equals[step]) if step < len(naming.accepted) else set()
    best = max(shown[0].net, 1e-9)
    bars = []
    for suspect in shown:
        role = "chosen" if suspect.name in accepted else "equal" if suspect.name in equals else "other"
        behind = shown[0].net - suspect.net
        text = f"{suspect.net:+.0f} nats" + (f", {behind:.0f} behind" if suspect is not shown[0] else "")
        text += {"chosen": " · added", "equal": " · an equal on these logs", "other": ""}[role]
        title = EFFECTS[suspect.name].title
        text = text.replace("-", "−")
        bars.append(Bar(f"{title[:1].upper()}{title[1:]}", suspect.name, max(suspect.net, 0.0) / best, text, role))
    found = step < len(naming.accepted)
    asked = "Each was" if step == 0 else "Beside what was added before, each was"
    ending = "" if found else " None gains enough to be believed."
    return Bars(
        tuple(bars),
        f"Step {step + 1}. {asked} fitted with all other parameters and the noise. A bar shows the net gain in "
        f"log-likelihood: the gain less the price of the parameters.{ending}",
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


def precision(estimate: Estimate) -> Drawing:
    """How well each parameter is known: its 95 % interval relative to its value."""
    every = zip(estimate.names, estimate.values, estimate.std, strict=True)
    known = {n: float(s / abs(v)) for n, v, s in every if v and np.isfinite(s)}
    names, std = list(known), np.array(list(known.values()))
    shown = [name.replace("theta", "θ") for name in names]
    half = 100 * NORMAL_95 * std
    figure = go.Figure()
    bars = {"type": "data", "array": half, "color": AFTER, "thickness": 2.0}
    points = go.Scatter(x=np.zeros(len(names)), y=shown, error_x=bars, mode="markers", showlegend=False)
    points.update(marker={"color": AFTER, "symbol": "diamond", "size": 9})
    figure.add_trace(points)
    reach = 1.1 * float(min(max(half.max(initial=0.0), 5.0), 150.0))
    figure.update_yaxes(categoryorder="array", categoryarray=shown[::-1])
    figure.update_xaxes(title_text="95 % interval [% of the value]", range=[-reach, reach])
    return drawing(
        "precision",
        figure,
        "The 95 % interval of each parameter, in per cent of its value.",
        "How well the logs determine each parameter. A bar that reaches ±100 % says that they hardly do.",
        90 + 30 * len(names),
    )
