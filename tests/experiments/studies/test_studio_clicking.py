"""The clicking of `experiments.studies.studio_clicking`, for some seconds."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("nicegui", reason="the studio needs NiceGUI (extra studio)")
pytest.importorskip("playwright", reason="the browser is driven by playwright")

from experiments.studies.studio_clicking import Clicked, click_about
from experiments.studio.drive import browser, chromium, served


def test_growth_compares_the_last_third_with_the_first() -> None:
    found = Clicked(memory=[(float(i), mb) for i, mb in enumerate([100.0, 100.0, 120.0, 130.0, 150.0, 150.0])])
    assert found.growth == pytest.approx(0.5)


@pytest.mark.skipif(chromium() is None, reason="no chromium is installed")
def test_a_page_stands_some_seconds_of_it_and_a_script_that_fails_is_seen(tmp_path: Path) -> None:
    with served(tmp_path) as studio, browser() as window:
        page = window.new_page()
        page.goto(studio.address)
        page.get_by_role("button", name="Open the demo's log").click()
        page.get_by_text("How it is read").wait_for(timeout=60_000)
        found = click_about(page, studio.process.pid, 5.0)
        assert found.wrong == []
        assert found.actions.total() > 3
        page.evaluate("setInterval(() => { throw new Error('broken on purpose') }, 100)")
        assert "broken on purpose" in click_about(page, studio.process.pid, 5.0).wrong[0]
