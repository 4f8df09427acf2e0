"""The page of one tab: its header with the views, the view, and the footer."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from pathlib import Path

from nicegui import context, ui

from .frame import Frame
from .session import Session
from .style import CSS
from .views import diagnose, export, identify, log, residuals, what_if

VIEWS = {
    "Log": log.show,
    "Identify": identify.show,
    "What if": what_if.show,
    "Residuals": residuals.show,
    "Diagnose": diagnose.show,
    "Export": export.show,
}


async def draw(folder: Path, logs: Sequence[Path]) -> Frame:
    """Draw the page for one tab, with a session of its own."""
    ui.add_css(CSS)
    ui.colors(primary="#0b5cad")
    frame = Frame(Session(folder), VIEWS, "Log")
    ui.page_title("furuta studio")
    with ui.header().classes("header"):
        ui.label("furuta studio").classes("brand")
        with ui.tabs(value="Log", on_change=lambda e: _chosen(frame, e.value)).props(
            "dense no-caps mobile-arrows outside-arrows"
        ).classes("tabs") as frame.tabs:
            for name in VIEWS:
                ui.tab(name)
    with ui.element("main").classes("main") as frame.body:
        pass
    with ui.footer().classes("footer"):
        frame.footer = ui.label("Nothing leaves this machine.").props("role=status")
    context.client.on_delete(frame.session.close)
    frame.show()
    if logs:
        await context.client.connected()
        frame.doing = "Reading the logs"
        frame.show()
        await asyncio.sleep(0)
        frame.doing = ""
        for path in logs:
            await log.add(frame, path)
    return frame


def _chosen(frame: Frame, name: str) -> None:
    if name != frame.current:
        frame.failure = ""
        frame.show(name)
