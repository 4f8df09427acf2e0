"""Play: the log and the what-if plant side by side, or a controller in closed loop on the plant, with pushes."""

from __future__ import annotations

from nicegui import ui

from ..frame import Frame, heading
from . import closed_loop, replay


class Kind:
    """What this view keeps: which of the two is shown."""

    name = "Replay"


KINDS = {"Replay": replay, "Closed loop": closed_loop}


def show(frame: Frame) -> None:
    kind = frame.of(Kind)
    heading("Play")
    ui.toggle(list(KINDS), value=kind.name, on_change=lambda e: _choose(frame, str(e.value))).props(
        "no-caps unelevated toggle-color=primary"
    )
    KINDS[kind.name].show(frame)


def _choose(frame: Frame, name: str) -> None:
    frame.of(Kind).name = name
    frame.show()
