"""What the search compared: the suspects of each step, and the parameters before and after."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import plotly.graph_objects as go

from furuta_gym.plant import EFFECTS
from furuta_gym.plant.covariance import NORMAL_95
from identification.diagnosis.naming.found import Naming
from identification.estimation.estimate import Estimate

from .contents import Bar, Bars
from .drawing import AFTER, BEFORE, Drawing, drawing

_MOST = 8


def rankings(naming: Naming) -> list[Bars]:
    """Suspects of each step by what they gain; the one that was found and its equals stand out."""
    return [_ranking(naming, step) for step in range(len(naming.rankings)) if naming.rankings[step]]


def _ranking(naming: Naming, step: int) -> Bars:
    shown = naming.rankings[step][:_MOST]
    found = step < len(naming.found)
    equals = naming.found[step].equals if found else ()
    best = max(shown[0].net, 1e-9)
    bars = []
    for suspect in shown:
        role = "chosen" if suspect.name in naming.names else "equal" if suspect.name in equals else "other"
        behind = shown[0].net - suspect.net
        text = f"{suspect.net:+.0f} nats" + (f", {behind:.0f} behind" if suspect is not shown[0] else "")
        text += {"chosen": " · added", "equal": " · an equal on these logs", "other": ""}[role]
        title = EFFECTS[suspect.name].title
        text = text.replace("-", "−")
        bars.append(Bar(f"{title[:1].upper()}{title[1:]}", suspect.name, max(suspect.net, 0.0) / best, text, role))
    asked = "Each was" if step == 0 else "Beside what was added before, each was"
    ending = "" if found else " None gains enough to be believed."
    return Bars(
        tuple(bars),
        f"Step {step + 1}. {asked} fitted with all other parameters and the noise. A bar shows the net gain in "
        f"log-likelihood: the gain less the price of the parameters.{ending}",
    )


def parameters(before: Estimate, after: Estimate) -> Drawing:
    """Relative change of the parameters of model (5), with 95 % bars of both estimates.

    A parameter that one of the two does not know has no place on the axis, and is named there instead."""
    names = [n for n in before.names if n in after.names and before.value(n)]
    lost = {n: [side for side, e in (("before", before), ("after", after)) if not _known(e, n)] for n in names}
    base = {n: abs(before.value(n)) for n in names}
    figure, bars = go.Figure(), []
    for label, estimate, colour, symbol in (
        ("before", before, BEFORE, "circle-open"),
        ("after", after, AFTER, "diamond"),
    ):
        for n in (n for n in names if not lost[n]):
            half = NORMAL_95 * estimate.std[estimate.names.index(n)] / base[n]
            bars.append(_Bar(_greek(n), 100 * (estimate.value(n) - before.value(n)) / base[n], 100 * half, colour))
        mine = [bar for bar in bars if bar.colour == colour]
        figure.add_trace(_points(mine, colour, symbol, 1.4, name=label))
    low, high = _reach(bars)
    _mark(figure, bars, low, high)
    told = {_greek(n): f"not identified {' and '.join(sides)}" for n, sides in lost.items() if sides}
    _say(figure, told, low, high)
    figure.update_yaxes(categoryorder="array", categoryarray=[_greek(n) for n in names][::-1])
    figure.update_xaxes(title_text="change [%]", range=[low, high])
    return drawing(
        "parameters",
        figure,
        "Relative change of each parameter when the effects are added, with 95 % bars.",
        "The parameters of model (5) without and with the effects, relative to the value without, with 95 % bars. "
        "What moves by more than its bars was biased by the missing effect." + _cut_short(bars, low, high),
        100 + 32 * len(names),
    )


def precision(estimate: Estimate) -> Drawing:
    """How well each parameter is known: its 95 % interval relative to its value."""
    names = [n for n in estimate.names if estimate.value(n) or not _known(estimate, n)]
    bars = []
    for n in (n for n in names if _known(estimate, n)):
        half = NORMAL_95 * estimate.std[estimate.names.index(n)] / abs(estimate.value(n))
        bars.append(_Bar(_greek(n), 0.0, 100 * half, AFTER))
    figure = go.Figure(_points(bars, AFTER, "diamond", 2.0, showlegend=False))
    low, high = _reach(bars)
    _mark(figure, bars, low, high)
    _say(figure, {_greek(n): "not identified" for n in names if not _known(estimate, n)}, low, high)
    figure.update_yaxes(categoryorder="array", categoryarray=[_greek(n) for n in names][::-1])
    figure.update_xaxes(title_text="95 % interval [% of the value]", range=[low, high])
    return drawing(
        "precision",
        figure,
        "The 95 % interval of each parameter, in per cent of its value.",
        "How well the logs determine each parameter. A bar that reaches ±100 % says that they hardly do."
        + _cut_short(bars, low, high),
        90 + 30 * len(names),
    )


@dataclass(frozen=True)
class _Bar:
    """A point with its 95 % bar [%], in the row of a parameter."""

    row: str
    at: float
    half: float
    colour: str


_SAYS_LITTLE = 100.0  # %; a longer bar says that a parameter is hardly known, and may not set the axis for the others
_LEAST = 5.0  # %; a narrower axis would blow up errors of no consequence


def _greek(name: str) -> str:
    return name.replace("theta", "θ")


def _known(estimate: Estimate, name: str) -> bool:
    std = estimate.std[estimate.names.index(name)]
    return name not in estimate.identifiability.unidentified and bool(np.isfinite(std))


def _points(bars: Sequence[_Bar], colour: str, symbol: str, width: float, **more: Any) -> go.Scatter:
    error = {"type": "data", "array": [bar.half for bar in bars], "color": colour, "thickness": width}
    points = go.Scatter(x=[bar.at for bar in bars], y=[bar.row for bar in bars], error_x=error, mode="markers", **more)
    return points.update(marker={"color": colour, "symbol": symbol, "size": 9})


def _reach(bars: Sequence[_Bar]) -> tuple[float, float]:
    """Ends of the axis [%]: around every point, and every bar that says something."""
    halves = [bar.half if bar.half <= _SAYS_LITTLE else 0.0 for bar in bars]
    low = min([-_LEAST, *(bar.at - half for bar, half in zip(bars, halves, strict=True))])
    high = max([_LEAST, *(bar.at + half for bar, half in zip(bars, halves, strict=True))])
    margin = 0.05 * (high - low)
    return low - margin, high + margin


def _mark(figure: go.Figure, bars: Sequence[_Bar], low: float, high: float) -> None:
    """An arrow head at the end of the axis where a bar goes on."""
    for end, symbol, beyond in (
        (low, "triangle-left", [bar for bar in bars if bar.at - bar.half < low]),
        (high, "triangle-right", [bar for bar in bars if bar.at + bar.half > high]),
    ):
        if beyond:
            marker = {"color": [bar.colour for bar in beyond], "symbol": symbol, "size": 11}
            rows = [bar.row for bar in beyond]
            heads = {"x": [end] * len(rows), "y": rows, "mode": "markers", "marker": marker}
            figure.add_trace(go.Scatter(**heads, name="goes on", showlegend=False, cliponaxis=False))


def _cut_short(bars: Sequence[_Bar], low: float, high: float) -> str:
    cut = any(bar.at - bar.half < low or bar.at + bar.half > high for bar in bars)
    return " A bar with an arrow head goes on beyond the axis." if cut else ""


def _say(figure: go.Figure, told: Mapping[str, str], low: float, high: float) -> None:
    """Words in the rows of parameters that have no place on the axis."""
    if told:
        words = {"x": [0.5 * (low + high)] * len(told), "y": list(told), "text": list(told.values()), "mode": "text"}
        figure.add_trace(go.Scatter(**words, name="no place", showlegend=False, hoverinfo="skip"))
