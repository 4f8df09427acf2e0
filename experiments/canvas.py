"""A Matplotlib figure that needs no screen and touches no global state."""

from __future__ import annotations

from typing import Any


def blank_figure(width: float, height: float) -> Any:
    """An empty figure of so many inches, laid out by itself. Matplotlib is imported only now."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure
