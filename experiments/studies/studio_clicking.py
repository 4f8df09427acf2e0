"""Random clicking in the studio by a script: no exception, no failed script, no growth.

python -m experiments.studies.studio_clicking [--minutes 30] [--seed 0]

A browser opens a log or a saved session, and clicks, types and drags at random. It stays some actions in a view and
then goes to the one that had the fewest; a session that was read otherwise in the view Log, and so lost its fit, is
opened again. What the page says of wrong input is expected; an exception in the page or on the server, a lost server,
or the sentence for a failed computation is not. The memory of the server is compared between the first and the last
third of the time, after what compiles has been compiled.
"""

from __future__ import annotations

import argparse
import random
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from experiments.studio.drive import browser, fit_in, served
from experiments.studio.footprint import memory
from experiments.studio.frame import VIEWS

GROWTH = 0.1
"""Share by which the memory may be larger in the last third than in the first."""
NOT_CLICKED = ("Diagnose", "Go on", "Search again", "Fit this one", "Remove")
"""Buttons that start minutes of work each, or that take the log away. A search is started, and soon stopped."""
STAY = (6, 20)
"""Actions in a view before the next."""
_FAILED = "This computation failed"
_WAIT = 60_000  # ms, for a computation that ends by itself
Act = Callable[[Any, random.Random], bool]


@dataclass
class Clicked:
    """actions by view and kind, missed: those that found nothing to act on, memory as (seconds, MB), and what went
    wrong in sentences."""

    actions: Counter[tuple[str, str]] = field(default_factory=Counter)
    missed: Counter[tuple[str, str]] = field(default_factory=Counter)
    memory: list[tuple[float, float]] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)

    @property
    def growth(self) -> float:
        """Mean memory of the last third over that of the first, less 1."""
        third = max(1, len(self.memory) // 3)
        first = [mb for _, mb in self.memory[:third]]
        last = [mb for _, mb in self.memory[-third:]]
        return (sum(last) / len(last)) / (sum(first) / len(first)) - 1.0

    def of(self, view: str) -> int:
        """Actions in a view."""
        return sum(n for (where, _), n in self.actions.items() if where == view)


def click_about(
    page: Any, process: int, seconds: float, seed: int = 0, skip: float = 0.0, session: Path | None = None
) -> Clicked:
    """Act at random on an open page. skip [s]: of the start, for which no memory is noted. session: a saved one that
    is opened again where the present one has lost its fit."""
    draw, found = random.Random(seed), Clicked()
    page.on("pageerror", lambda error: found.wrong.append(f"script: {error}"))
    page.set_default_timeout(3_000)
    began, noted = time.monotonic(), 0.0
    view, left, kind = "", 0, ""
    while (now := time.monotonic() - began) < seconds and not found.wrong:
        try:
            kind = "opening"
            if left <= 0:
                view, left = _next_view(found, draw), draw.randint(*STAY)
                _open(page, view, session, found)
            left -= 1
            view = page.locator(".q-tab--active").inner_text()  # some buttons lead to another one
            kind, act = draw.choice(_ACTS + _ACTS_IN.get(view, []))
            (found.actions if act(page, draw) else found.missed)[view, kind] += 1
        except Exception as error:  # what was drawn has gone meanwhile, or lies under something
            found.missed[view, kind] += 1
            if "closed" in str(error) or "crashed" in str(error):
                found.wrong.append(str(error).splitlines()[0])
        if (failed := page.get_by_text(_FAILED)).count():
            found.wrong.append(failed.first.inner_text())
        if now - noted > max(2.0, seconds / 200):
            noted = now
            if now >= skip:
                found.memory.append((now, memory(process)[0]))
    return found


def _next_view(found: Clicked, draw: random.Random) -> str:
    fewest = min(found.of(view) for view in VIEWS)
    return draw.choice([view for view in VIEWS if found.of(view) == fewest])


def _open(page: Any, view: str, session: Path | None, found: Clicked) -> None:
    """Show a view, with a session whose fit is there."""
    page.keyboard.press("Escape")
    if session is not None:
        _show(page, "Log")
        page.locator(".doing").wait_for(state="hidden", timeout=_WAIT)
        page.wait_for_timeout(1500)  # until a log that was turned is read again, which draws the view anew
        if not page.get_by_text("These logs are used").is_visible():
            page.locator("input[type=file]").first.set_input_files(str(session))
            page.get_by_text("Is the model adequate?").wait_for(timeout=_WAIT)
            found.actions["Log", "session opened again"] += 1
    _show(page, view)
    page.wait_for_timeout(300)
    start = page.get_by_role("button", name="Start", exact=True)
    if view == "What if" and start.is_visible():
        start.click()
        page.locator(".chart.live canvas").first.wait_for(timeout=_WAIT)


def _show(page: Any, view: str) -> None:
    page.get_by_role("tab", name=view, exact=True).click()
    page.locator(f"main[data-view='{view}']").wait_for(timeout=20_000)


def _one(page: Any, draw: random.Random, what: str) -> Any | None:
    """One of the controls of the view, None where it has none."""
    n = (controls := page.locator(f"main {what}").locator("visible=true")).count()
    return controls.nth(draw.randrange(n)) if n else None


def _button(page: Any, draw: random.Random) -> bool:
    button = _one(page, draw, "button:enabled")
    if button is None:
        return False
    name = (button.get_attribute("aria-label") or button.inner_text()).strip().splitlines()[-1]
    if name.startswith(NOT_CLICKED):
        return False
    button.click()
    page.wait_for_timeout(draw.choice((50, 300, 1000)))
    return True


def _slider(page: Any, draw: random.Random) -> bool:
    slider = _one(page, draw, ".q-slider__track-container")
    if slider is None:
        return False
    slider.scroll_into_view_if_needed()
    box = slider.bounding_box()
    y = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + draw.random() * box["width"], y)
    page.mouse.down()
    for _ in range(draw.randint(0, 20)):
        page.mouse.move(box["x"] + draw.random() * box["width"], y)
        page.wait_for_timeout(20)
    page.mouse.up()
    page.wait_for_timeout(draw.choice((0, 400, 2000)))  # the noise is fitted at rest, and then the floor
    return True


def _number(page: Any, draw: random.Random) -> bool:
    box = _one(page, draw, "input[type=number]:enabled")
    if box is None:
        return False
    box.fill(draw.choice(("0", "-1", "1e9", "0.01", "", "3")))
    return True


def _choice(page: Any, draw: random.Random) -> bool:
    select = _one(page, draw, ".q-select")
    if select is None:
        return False
    select.click()
    options = page.locator(".q-menu .q-item")
    options.first.wait_for(timeout=1000)
    options.nth(draw.randrange(min(12, options.count()))).click()
    return True


def _key(page: Any, draw: random.Random) -> bool:
    for _ in range(draw.randint(1, 8)):
        page.keyboard.press(draw.choice(("Tab", "ArrowRight", "ArrowLeft", "Escape", "Shift+Tab")))
    return True


def _size(page: Any, draw: random.Random) -> bool:
    page.set_viewport_size({"width": draw.choice((400, 1024, 1440)), "height": 900})
    return True


def _look(page: Any, draw: random.Random) -> bool:
    """Scroll, and let what moves by itself move."""
    page.mouse.wheel(0, draw.choice((-600, 300, 600)))
    page.wait_for_timeout(draw.choice((100, 1000)))
    return True


def _search(page: Any, draw: random.Random) -> bool:
    """Start a search, look at it, and stop it: it ends with the fit that it makes."""
    run = page.locator("main").get_by_role("button", name="Diagnose", exact=True)
    run = run if run.count() else page.locator("main").get_by_role("button", name="Go on", exact=True)
    if not run.count() or not run.is_enabled():
        return False
    run.click()
    stop = page.get_by_role("button", name="Stop and keep what is known")
    stop.wait_for()
    page.wait_for_timeout(draw.choice((200, 2000, 5000)))
    stop.click()
    stop.wait_for(state="detached", timeout=_WAIT)
    return True


_ACTS: list[tuple[str, Act]] = [
    *[("button", _button)] * 3,
    ("choice", _choice),
    ("key", _key),
    ("size", _size),
    ("look", _look),
]
_ACTS_IN: dict[str, list[tuple[str, Act]]] = {
    "What if": [*[("slider", _slider)] * 7, ("number", _number), ("choice", _choice)],
    "Residuals": [*[("slider", _slider)] * 2, ("choice", _choice)],
    "Diagnose": [("search", _search)],
    "Play": [*[("slider", _slider)] * 3, ("choice", _choice)],
}
"""What is done in every view, and more often where a view has it."""


def run(log: Path, minutes: float, seed: int) -> Clicked:
    """Fit a log, save the session, and click about."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        errors = folder / "server.txt"
        with served(folder, log.resolve(), errors=errors) as studio, browser() as window:
            page = window.new_page(viewport={"width": 1024, "height": 900})
            page.goto(studio.address)
            if not log.name.endswith(".furuta"):
                fit_in(page)
            page.get_by_text("Is the model adequate?").wait_for(timeout=_WAIT)
            page.get_by_role("tab", name="Export").click()
            page.get_by_role("button", name="Write session.furuta").click()
            page.get_by_text("Written: ").wait_for()
            kept = folder / "kept.furuta"
            (folder / "session.furuta").rename(kept)
            skip = min(300.0, 10.0 * minutes)
            found = click_about(page, studio.process.pid, 60.0 * minutes, seed, skip, kept)
            if studio.process.poll() is not None:
                found.wrong.append("the server has ended")
        told = errors.read_text(encoding="utf-8", errors="replace")
        if "Traceback" in told:
            found.wrong.append(f"the server: {told[-3000:]}")
        return found


def main() -> None:
    """Click and print what was seen; exit code 1 where something went wrong."""
    default = Path(__file__).parents[1] / "demo" / "logs" / "wide.csv"
    parser = argparse.ArgumentParser(description="Random clicking in the studio.")
    parser.add_argument("log", nargs="?", type=Path, default=default, help="a log, or a saved session")
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    found = run(asked.log, asked.minutes, asked.seed)
    print(f"{asked.minutes:g} minutes, seed {asked.seed}: {found.actions.total()} actions")
    for view in VIEWS:
        kinds = sorted((kind, n) for (where, kind), n in found.actions.items() if where == view)
        print(f"  {view}: {found.of(view)} ({', '.join(f'{n} × {kind}' for kind, n in kinds)})")
    missed = ", ".join(f"{n} × {kind} in {view}" for (view, kind), n in sorted(found.missed.items()))
    print(f"nothing to act on, or it went meanwhile: {missed}")
    mb = [m for _, m in found.memory] or [float("nan")]
    print(f"memory of the server: {min(mb):.0f} to {max(mb):.0f} MB, growth {100 * found.growth:+.1f} %")
    for text in found.wrong:
        print(f"wrong: {text}")
    if found.wrong or found.growth > GROWTH:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
