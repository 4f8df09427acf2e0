"""What a tab leaves behind when it is closed."""

from __future__ import annotations

import asyncio
import gc
import time
import weakref
from pathlib import Path
from threading import Event
from typing import Any

import pytest

from experiments.studio.frame import VIEWS, Frame
from experiments.studio.views import diagnose as diagnose_view
from experiments.studio.views import identify as identify_view
from experiments.studio.work import Cancelled
from furuta_gym.plant import TABLE_3
from identification.diagnosis.watched import Tried
from tests.studio import until, visit


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


@pytest.mark.parametrize("name", ["Identify", "Diagnose"])
def test_a_closed_tab_ends_its_fit_or_search(
    tmp_path: Path, spring_log: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    began, ended = Event(), Event()

    def search(logs: Any, progress: Any, journal: Path, watch: Any) -> None:
        goes_on(lambda: watch(Tried(TABLE_3, 100.0, False)))

    def fit(logs: Any, pool: Any) -> None:
        goes_on(lambda: list(pool.map(abs, [1])))

    def goes_on(step: Any) -> None:
        began.set()
        until = time.monotonic() + 20.0
        try:
            while time.monotonic() < until:
                step()
                time.sleep(0.01)
        except Cancelled:
            ended.set()
            raise

    async def scenario(user: Any, frame: Any) -> None:
        frame.session.accept()
        monkeypatch.setattr(diagnose_view, "diagnose", search)
        monkeypatch.setattr(identify_view, "identify", fit)
        frame.show(name)
        user.find(marker=f"run-{name.lower()}").click()
        await until(began.is_set)
        user.client.delete()
        user.client = None
        await until(ended.is_set, 10.0)
        await until(lambda: not frame.doing)
        assert not frame.failure

    visit(scenario, tmp_path, [spring_log])
