"""Random clicking in the studio by a script: no exception, no failed script, no growth.

python -m experiments.studies.studio_clicking [--minutes 30] [--seed 0]

A browser opens a saved session, and clicks, types and drags at random in all views. What the page says of wrong input
is expected; an exception in the page, a lost server, or the sentence for a failed computation is not. The memory of the
server is compared between the first and the last third of the time, after what compiles has been compiled.
"""

from __future__ import annotations

import argparse
import random
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from experiments.studio.drive import browser, fit_in, served
from experiments.studio.footprint import memory
from experiments.studio.frame import VIEWS

GROWTH = 0.1
"""Share by which the memory may be larger in the last third than in the first."""
NOT_CLICKED = ("Diagnose", "Go on", "Search again", "Fit this one", "Remove")
"""Buttons that start minutes of work each, or that take the log away."""
_FAILED = "This computation failed"


@dataclass
class Clicked:
    """clicks by kind, memory as (seconds, MB), and what went wrong in sentences."""

    clicks: dict[str, int] = field(default_factory=dict)
    memory: list[tuple[float, float]] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)

    @property
    def growth(self) -> float:
        """Mean memory of the last third over that of the first, less 1."""
        third = max(1, len(self.memory) // 3)
        first = [mb for _, mb in self.memory[:third]]
        last = [mb for _, mb in self.memory[-third:]]
        return (sum(last) / len(last)) / (sum(first) / len(first)) - 1.0


def click_about(page: Any, process: int, seconds: float, seed: int = 0, skip: float = 0.0) -> Clicked:
    """Act at random on an open page. skip [s]: of the start, for which no memory is noted."""
    draw, found = random.Random(seed), Clicked()
    page.on("pageerror", lambda error: found.wrong.append(f"script: {error}"))
    page.set_default_timeout(3_000)
    began, noted = time.monotonic(), 0.0
    while (now := time.monotonic() - began) < seconds and not found.wrong:
        kind, act = draw.choice(_ACTS)
        try:
            act(page, draw)
        except Exception as error:  # what was drawn has gone meanwhile, or lies under something
            if "closed" in str(error) or "crashed" in str(error):
                found.wrong.append(str(error).splitlines()[0])
            continue
        found.clicks[kind] = found.clicks.get(kind, 0) + 1
        if page.get_by_text(_FAILED).count():
            found.wrong.append(page.get_by_text(_FAILED).first.inner_text())
        if now - noted > max(2.0, seconds / 200):
            noted = now
            if now >= skip:
                found.memory.append((now, memory(process)[0]))
    return found


def _view(page: Any, draw: random.Random) -> None:
    page.get_by_role("tab", name=draw.choice(list(VIEWS)), exact=True).click()
    page.wait_for_timeout(draw.choice((50, 300, 1000)))


def _button(page: Any, draw: random.Random) -> None:
    buttons = [b for b in page.get_by_role("button").all() if b.is_visible() and b.is_enabled()]
    button = draw.choice(buttons)
    name = (button.get_attribute("aria-label") or button.inner_text()).strip().splitlines()[-1]
    if not name.startswith(NOT_CLICKED):
        button.click()


def _slider(page: Any, draw: random.Random) -> None:
    sliders = [s for s in page.locator(".q-slider__track-container").all() if s.is_visible()]
    slider = draw.choice(sliders)
    slider.scroll_into_view_if_needed()
    box = slider.bounding_box()
    y = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + draw.random() * box["width"], y)
    page.mouse.down()
    for _ in range(draw.randint(0, 20)):
        page.mouse.move(box["x"] + draw.random() * box["width"], y)
        page.wait_for_timeout(20)
    page.mouse.up()


def _number(page: Any, draw: random.Random) -> None:
    boxes = [b for b in page.locator("input[type=number]").all() if b.is_visible() and b.is_enabled()]
    draw.choice(boxes).fill(draw.choice(("0", "-1", "1e9", "0.01", "", "3")))


def _choice(page: Any, draw: random.Random) -> None:
    selects = [s for s in page.locator(".q-select").all() if s.is_visible()]
    draw.choice(selects).click()
    options = page.locator(".q-menu .q-item").all()
    if options:
        draw.choice(options[:12]).click()


def _key(page: Any, draw: random.Random) -> None:
    for _ in range(draw.randint(1, 8)):
        page.keyboard.press(draw.choice(("Tab", "ArrowRight", "ArrowLeft", "Escape", "Shift+Tab")))


def _size(page: Any, draw: random.Random) -> None:
    page.set_viewport_size({"width": draw.choice((400, 1024, 1440)), "height": 900})


_ACTS = [
    *[("view", _view)] * 3,
    *[("button", _button)] * 4,
    *[("slider", _slider)] * 4,
    ("number", _number),
    *[("choice", _choice)] * 2,
    ("key", _key),
    ("size", _size),
]


def run(log: Path, minutes: float, seed: int) -> Clicked:
    """Fit a log, start the view What if, and click about."""
    with tempfile.TemporaryDirectory() as folder, served(Path(folder), log.resolve()) as studio, browser() as window:
        page = window.new_page(viewport={"width": 1024, "height": 900})
        page.goto(studio.address)
        if not log.name.endswith(".furuta"):
            fit_in(page)
        page.get_by_text("Is the model adequate?").wait_for()
        return click_about(page, studio.process.pid, 60.0 * minutes, seed, skip=min(120.0, 10.0 * minutes))


def main() -> None:
    """Click and print what was seen; exit code 1 where something went wrong."""
    default = Path(__file__).parents[1] / "demo" / "logs" / "wide.csv"
    parser = argparse.ArgumentParser(description="Random clicking in the studio.")
    parser.add_argument("log", nargs="?", type=Path, default=default, help="a log, or a saved session")
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    found = run(asked.log, asked.minutes, asked.seed)
    clicks = ", ".join(f"{n} × {kind}" for kind, n in sorted(found.clicks.items()))
    print(f"{asked.minutes:g} minutes, seed {asked.seed}: {sum(found.clicks.values())} actions ({clicks})")
    mb = [m for _, m in found.memory] or [float("nan")]
    print(f"memory of the server: {min(mb):.0f} to {max(mb):.0f} MB, growth {100 * found.growth:+.1f} %")
    for text in found.wrong:
        print(f"wrong: {text}")
    if found.wrong or found.growth > GROWTH:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
