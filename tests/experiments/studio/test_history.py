"""The browser's own buttons, and what is in sight, in Debian's Chromium."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from experiments.studio.drive import served, start_what_if


@pytest.fixture
def page(window: Any, tmp_path: Path, session_file: Path) -> Iterator[Any]:
    """A tab with the saved session."""
    with served(tmp_path) as studio:
        page = window.new_page(viewport={"width": 800, "height": 900})
        page.set_default_timeout(60_000)
        page.goto(studio.address)
        page.locator("input[type=file]").first.set_input_files(str(session_file))
        page.get_by_text("Is the model adequate?").wait_for()
        yield page
        page.close()


def shows(page: Any, view: str) -> None:
    """Wait for a view, and until the browser's history knows it: a script goes "back" sooner than a hand could."""
    page.locator(f"main[data-view='{view}']").wait_for()
    page.wait_for_function(f"history.state?.view === '{view}'")


def test_back_shows_the_view_before_and_leaving_asks_where_something_would_be_lost(page: Any) -> None:
    asked: list[str] = []
    page.on("dialog", lambda dialog: (asked.append(dialog.type), dialog.dismiss()))
    page.get_by_role("tab", name="Residuals").click()
    shows(page, "Residuals")
    page.go_back()
    shows(page, "Identify")
    page.go_forward()
    shows(page, "Residuals")
    assert page.evaluate("studio.keeps") is False  # a file has it all
    page.get_by_role("tab", name="What if").click()
    start_what_if(page)
    page.get_by_role("button", name="Reset").click()  # or the plant kept is the one that the file has
    page.get_by_text("arm_spring: arm").wait_for(state="detached")
    page.get_by_role("button", name="Keep as plant").click()
    page.wait_for_function("studio.keeps")
    with page.expect_event("dialog"):
        page.evaluate("setTimeout(() => location.reload())")
    assert asked == ["beforeunload"]
    shows(page, "What if")


def test_what_if_the_picture_stays_in_sight_of_the_last_slider(page: Any) -> None:
    start_what_if(page)
    page.locator("main .slider").last.scroll_into_view_if_needed()
    picture = page.locator(".chart.live").bounding_box()
    assert 0 < picture["y"] < 100
    assert page.locator("main .slider").last.bounding_box()["y"] > picture["y"] + picture["height"]


def test_a_sentence_that_something_failed_is_seen_from_below(page: Any) -> None:
    page.set_viewport_size({"width": 400, "height": 400})
    page.get_by_role("tab", name="Export").click()
    page.get_by_role("button", name="Write plant.xml").click()  # no rigid body has the parameters of this fit
    page.get_by_text("no rigid body has these parameters").wait_for()
    page.wait_for_function("scrollY === 0")
