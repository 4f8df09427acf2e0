"""The studio without a browser: `visit(scenario, …)` opens its page for one user and lets a scenario act. `serving`
runs the command."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from experiments.studio.drive import served


def visit(
    scenario: Callable[[Any, Any], Awaitable[None]],
    folder: Path,
    logs: Sequence[Path] = (),
    prepare: Callable[[Any], None] | None = None,
) -> None:
    """Run `scenario(user, frame)` on a page of its own. prepare(frame) is called once the logs are read."""
    from nicegui import background_tasks
    from nicegui.testing import user_simulation

    from experiments.studio.page import draw

    frames: list[Any] = []

    async def root() -> None:
        frames.append(await draw(folder, logs))

    async def walk() -> None:
        async with user_simulation(root=root) as user:
            await user.open("/")
            await until(lambda: frames and len(frames[0].session.paths) == len(logs))
            if prepare is not None:
                prepare(frames[0])
            await scenario(user, frames[0])
            for frame in frames:
                frame.session.close()

    try:
        asyncio.run(walk())
    finally:  # what a scenario that failed leaves would keep the next page from ever closing
        background_tasks.running_tasks.clear()
        background_tasks.lazy_tasks_running.clear()


async def until(condition: Callable[[], Any], seconds: float = 60.0) -> None:
    """Wait for a condition. Raises AssertionError where it does not come true."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if condition():
            return
        await asyncio.sleep(0.05)
    raise AssertionError(f"did not come true within {seconds:g} s")


def texts(user: Any) -> str:
    """What the page shows, as text."""
    from nicegui import ui

    def of(element: Any) -> str:
        own = getattr(element, "text", "") or ""
        return " ".join([str(own), *(of(child) for child in element.default_slot.children)])

    with user:
        return of(ui.context.client.layout)


@contextmanager
def serving(folder: Path, *logs: Path) -> Iterator[str]:
    """The studio as a process; gives its address."""
    with served(folder, *logs) as found:
        yield found.address


def known(fitted: Any) -> Any:
    """Accept the logs and put the fit in, as the views Log and Identify do."""

    def prepare(frame: Any) -> None:
        frame.session.accept()
        frame.session.estimate, frame.session.gap = fitted

    return prepare
