"""The studio without a browser: `visit(scenario, …)` opens its page for one user and lets a scenario act. `serving`
runs the command."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
from collections.abc import Awaitable, Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any


def visit(
    scenario: Callable[[Any, Any], Awaitable[None]],
    folder: Path,
    logs: Sequence[Path] = (),
    prepare: Callable[[Any], None] | None = None,
) -> None:
    """Run `scenario(user, frame)` on a page of its own. prepare(frame) is called once the logs are read."""
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

    asyncio.run(walk())


async def until(condition: Callable[[], Any], seconds: float = 60.0) -> None:
    """Wait for a condition. Raises AssertionError where it does not come true."""
    for _ in range(int(seconds / 0.05)):
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
    """`furuta studio LOG… --no-browser` as a process in a folder; gives the address that it prints."""
    root = Path(__file__).resolve().parent.parent
    command = [sys.executable, str(root / "furuta_command.py"), "studio", *map(str, logs), "--no-browser"]
    process = subprocess.Popen(
        command,
        cwd=folder,
        env={k: v for k, v in os.environ.items() if not k.startswith("PYTEST")} | {"PYTHONPATH": str(root)},
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    try:
        assert process.stdout is not None
        address = process.stdout.readline().strip()
        assert address.startswith("http://127.0.0.1:"), address
        yield address
    finally:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(15)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        process.stdout.close()  # type: ignore[union-attr]
