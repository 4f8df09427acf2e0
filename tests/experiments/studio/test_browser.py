"""The page in Debian's Chromium: from a log to the slider, and no request leaves the machine."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.studio import serving

playwright = pytest.importorskip("playwright.sync_api", reason="the browser test needs playwright")
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium is installed")
def test_from_the_log_to_the_slider(tmp_path: Path, spring_log: Path) -> None:
    strange: list[str] = []
    errors: list[str] = []
    with serving(tmp_path, spring_log) as address, playwright.sync_playwright() as p:
        browser = p.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1024, "height": 900})
        page.set_default_timeout(120_000)
        page.on("request", lambda r: None if _own(r.url) else strange.append(r.url))
        page.on("pageerror", lambda e: errors.append(str(e)))
        page.goto(address)
        page.get_by_role("button", name="Flip the sign of the pendulum").click()
        page.get_by_role("button", name="Read zero and signs as the motion shows them").click()
        page.get_by_text("wrong", exact=True).wait_for(state="hidden")
        page.get_by_role("button", name="Use these logs").focus()
        page.keyboard.press("Enter")  # the keyboard does it
        page.get_by_role("button", name="Identify", exact=True).click()
        page.get_by_text("Is the model adequate?").wait_for()
        page.get_by_role("tab", name="What if").click()
        page.get_by_role("button", name="Start").click()
        page.get_by_text("Slider to picture").wait_for()
        before = page.locator(".q-footer").inner_text()
        page.locator(".slider .q-slider__track-container").first.click(position={"x": 90, "y": 5})
        page.wait_for_function("text => document.querySelector('.q-footer').innerText !== text", arg=before)
        page.set_viewport_size({"width": 400, "height": 800})
        wide = page.evaluate("document.documentElement.scrollWidth")
        browser.close()
    assert strange == []
    assert errors == []
    assert wide <= 400


def _own(url: str) -> bool:
    return url.startswith(("http://127.0.0.1:", "ws://127.0.0.1:", "data:", "blob:"))
