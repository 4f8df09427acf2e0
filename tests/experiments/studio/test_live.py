"""What follows the sliders: numbers belong to the window that is shown."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest

from experiments.studio.views import live as module
from experiments.studio.views.live import Live, compute


@pytest.mark.parametrize("measured_anew", [False, True])
def test_numbers_of_a_window_whose_floor_was_measured_anew_are_left(
    monkeypatch: pytest.MonkeyPatch, measured_anew: bool
) -> None:
    """The measurement of the floor ends while a picture of the window before it is being measured."""
    live = Live()
    other: Any = SimpleNamespace()

    def measured(picture: object) -> Any:
        if measured_anew:
            live.window = other
        return "its numbers"

    picture = SimpleNamespace(angles=None, settled=False)
    window: Any = SimpleNamespace(log=SimpleNamespace(t=None), picture=lambda plant, settle: picture, measured=measured)
    live.window, live.choice = window, SimpleNamespace(plant=lambda: None)  # type: ignore[assignment]
    live.chart = SimpleNamespace(is_deleted=False)

    async def drawn(*_: object) -> None:
        """No browser."""

    monkeypatch.setattr(module, "_draw", drawn)
    monkeypatch.setattr(module, "say", lambda live, moving=False: None)
    monkeypatch.setattr(module.charts, "simulated", lambda t, angles: [])
    asyncio.run(compute(SimpleNamespace(), live))  # type: ignore[arg-type]
    assert live.last == (None if measured_anew else "its numbers")
