"""A learned torque as curves, so that a person may recognise the law behind it."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go

from furuta_gym.plant.effects.learned import COEFFICIENTS, surface_columns
from identification.diagnosis.learned import Learned

from .drawing import AFTER, BEFORE, MEASURED, Drawing, drawing

_SPEEDS = (-3.0, -1.0, 0.0, 1.0, 3.0)  # times the speed below which half of the readings lie
_LOOKS = ((BEFORE, "dot"), (BEFORE, "solid"), (MEASURED, "solid"), (AFTER, "solid"), (AFTER, "dot"))


def curves(learned: Learned) -> Drawing:
    """The learned torque against the arm's angle at five speeds."""
    effect = learned.effect
    assert effect is not None
    p = effect.parameters
    coefficients = np.array([p[name] for name in COEFFICIENTS])
    angle = np.linspace(p["low"], p["low"] + p["width"], 81)
    figure = go.Figure()
    for times, (colour, dash) in zip(_SPEEDS, _LOOKS, strict=True):
        v1 = times * p["w"]
        torque = surface_columns(angle, np.full_like(angle, v1), p["low"], p["width"], p["w"]) @ coefficients
        figure.add_trace(
            go.Scatter(
                x=angle.round(4),
                y=np.round(torque, 6),
                mode="lines",
                line={"color": colour, "dash": dash, "width": 2},
                name=f"{v1:+.2g} rad/s".replace("-", "−"),
            )
        )
    figure.update_xaxes(title_text="arm angle q1 [rad]")
    figure.update_yaxes(title_text=f"learned torque [{learned.plant.unit}]")
    return drawing(
        "learned",
        figure,
        "Curves of the learned torque on the arm against its angle, one for each of five speeds",
        "Torque on the arm that was learned, at five speeds of the arm. Curves that lie on one another: it depends on "
        "the angle alone. Level curves apart from each other: friction. Beyond the ends it stays as it is there.",
        360,
    )
