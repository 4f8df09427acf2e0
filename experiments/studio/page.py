"""The page of one tab: its header with the views, the view, and the footer."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from pathlib import Path

from nicegui import context, ui

from identification import RigMapping

from .frame import VIEWS, Frame, view


def load() -> None:
    """Load what the views need, so that the first page need not wait for it."""
    for name in VIEWS:
        view(name)


async def draw(folder: Path, logs: Sequence[Path], stated: RigMapping | None = None) -> Frame:
    """Draw the page for one tab, with a session of its own. stated: how the command line says that logs are read."""
    from .session import Session
    from .views.log import add

    ui.add_css(Path(__file__).with_name("style.css"))
    ui.add_head_html(f"<script>{Path(__file__).with_name('client.js').read_text(encoding='utf-8')}</script>")
    ui.colors(primary="#0b5cad")
    frame = Frame(Session(folder, stated))
    ui.page_title("furuta studio")
    with ui.header().classes("header"):
        ui.label("furuta studio").classes("brand")
        with (
            ui.tabs(on_change=lambda e: _chosen(frame, str(e.value)))
            .props("dense no-caps mobile-arrows outside-arrows")
            .classes("tabs") as frame.tabs
        ):
            for name in VIEWS:
                ui.tab(name)
            frame.tabs.set_value(frame.current)
    with ui.element("main").classes("main") as frame.body:
        pass
    with ui.footer().classes("footer"):
        frame.footer = ui.label("Nothing leaves this machine.").props("role=status")
    ui.on("studio_view", lambda e: _chosen(frame, str(e.args)))  # the browser's button "back"
    context.client.on_delete(frame.close)
    frame.show()
    if logs:
        await context.client.connected()
        frame.doing = "Reading the logs"
        frame.show()
        await asyncio.sleep(0)
        frame.doing = ""
        await add(frame, logs)
    return frame


def _chosen(frame: Frame, name: str) -> None:
    if name != frame.current and name in VIEWS:
        frame.failure = ""
        frame.show(name)
