"""What a tab leaves behind when it is closed."""

from __future__ import annotations

import asyncio
import gc
import weakref
from pathlib import Path
from typing import Any

from experiments.studio.frame import VIEWS, Frame
from tests.studio import until


def test_a_closed_tab_leaves_no_logs_behind(tmp_path: Path, session_file: Path) -> None:
    from nicegui.testing import user_simulation

    from experiments.studio.page import draw
    from experiments.studio.views.play import Kind

    logs: list[weakref.ref[Any]] = []

    async def root() -> None:
        frame: Frame = await draw(tmp_path, [session_file])
        assert frame.session.estimate is not None
        frame.of(Kind).name = "Closed loop"  # where policies are dropped
        for view in VIEWS:
            frame.show(view)
        logs.append(weakref.ref(frame.session.logs[0]))

    def forgotten() -> bool:
        gc.collect()
        return logs[0]() is None

    async def walk() -> None:
        async with user_simulation(root=root) as user:
            await user.open("/")
            await until(lambda: logs)
            user.client.delete()  # type: ignore[union-attr]
            user.client = None
            await until(forgotten, 10.0)

    asyncio.run(walk())
