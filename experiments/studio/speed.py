"""How long a slider takes to become a picture.

python -m experiments.studio.speed [LOG]            what is computed for one picture
python -m experiments.studio.speed [LOG] --browser  the whole way, from the hand to the painted picture, in Chromium;
                                                    a saved session in place of the log spares the fit

The footer of the page shows the whole way too.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import tempfile
import time
from dataclasses import dataclass
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from typing import Any

from furuta_gym import Plant
from identification import PredictionWindow, read_log

from . import charts
from .drive import LONGEST_WAIT, browser, fit_in, served, start_what_if

MOVES = 60
LONGEST = 100.0
"""Milliseconds from a slider to the picture, on a window of 5 s."""
EFFECTS = ("arm_spring", "arm_stribeck", "actuator_lag")


@dataclass(frozen=True)
class Computed:
    """Medians in milliseconds, of a window of so many samples and seconds: picture and numbers by the clock,
    picture_cpu and numbers_cpu of CPU time, which does not depend on what else the machine does, and to_json."""

    samples: int
    seconds: float
    picture: float
    picture_cpu: float
    numbers: float
    numbers_cpu: float
    to_json: float


def measure(path: Path, plant: Plant, effects: int = 3) -> Computed:
    """MOVES slider movements on the first window of a log, with some effects acting."""
    log = read_log(path)
    window = PredictionWindow.of(log, plant)
    for name in EFFECTS[:effects]:
        plant = plant.with_effects(plant.default_effect(name))
    window.predict(plant)
    rows = []
    for i in range(MOVES):
        theta = plant.theta.copy()
        theta[5] *= 1.0 + 0.001 * i
        clocks = [_clocks()]
        picture = window.picture(plant.replace(theta=theta))
        clocks.append(_clocks())
        json.dumps(charts.simulated(window.log.t, picture.angles))
        clocks.append(_clocks())
        window.measured(picture)
        clocks.append(_clocks())
        rows.append([1e3 * (b - a) for one, other in pairwise(clocks) for a, b in zip(one, other, strict=True)])
    picture_, picture_cpu, to_json, _, numbers, numbers_cpu = map(statistics.median, zip(*rows, strict=True))
    return Computed(len(window.log), window.log.duration, picture_, picture_cpu, numbers, numbers_cpu, to_json)


def _clocks() -> tuple[float, float]:
    return time.perf_counter(), time.thread_time()


@dataclass(frozen=True)
class Shown:
    """One picture in the browser, in milliseconds. took: from the newest movement that it shows; seen: from each one
    that no picture before shows. wait: until the server began; compute; encode: to JSON; draw: from when the browser
    has the curves until they are painted; transport: what is left, both ways, with what waits in the browser."""

    took: float
    seen: tuple[float, ...]
    wait: float
    compute: float
    encode: float
    draw: float
    transport: float


def drag(page: Any, moves: int = MOVES) -> list[Shown]:
    """Drag the first slider of the view What if, and give what each picture took by the browser's clock."""
    track = page.locator(".slider .q-slider__track-container").first
    track.scroll_into_view_if_needed()
    box = track.bounding_box()
    y = box["y"] + box["height"] / 2
    page.evaluate("studio.pictures.length = studio.waiting.length = 0")
    page.mouse.move(box["x"] + 0.2 * box["width"], y)
    page.mouse.down()
    for i in range(moves):
        page.mouse.move(box["x"] + (0.2 + 0.3 * (i + 1) / moves) * box["width"], y)
        page.wait_for_timeout(50)
    page.mouse.up()
    page.wait_for_timeout(1000)
    return [_typed(shown) for shown in page.evaluate("studio.pictures")]


def _typed(shown: dict[str, Any]) -> Shown:
    typed: dict[str, Any] = {**shown, "seen": tuple(shown["seen"])}
    return Shown(**typed)


def in_browser(path: Path) -> list[Shown]:
    """The same in Chromium, after a fit of the log."""
    with tempfile.TemporaryDirectory() as folder, served(Path(folder), path.resolve()) as studio, browser() as window:
        page = window.new_page(viewport={"width": 1280, "height": 900})
        page.goto(studio.address)
        if path.name.endswith(".furuta"):
            page.get_by_text("Is the model adequate?").wait_for()
        else:
            fit_in(page)
        page.set_default_timeout(LONGEST_WAIT)
        start_what_if(page)
        page.wait_for_timeout(5000)  # the floor is measured once more, which is not what is measured here
        drag(page, 5)
        return drag(page)


def told(shown: list[Shown]) -> str:
    """Medians of all movements and of each part, and the machine's load meanwhile."""
    seen = [ms for picture in shown for ms in picture.seen]
    parts = ", ".join(
        f"{part} {statistics.median(getattr(picture, part) for picture in shown):.0f}"
        for part in ("wait", "compute", "encode", "transport", "draw")
    )
    return (
        f"{len(seen)} movements, {len(shown)} pictures of 5 s: slider to picture {statistics.median(seen):.0f} ms in "
        f"the median, 95 % below {statistics.quantiles(seen, n=20)[-1]:.0f} ms (limit {LONGEST:.0f} ms)\n"
        f"of a picture, medians in ms: {parts}\n"
        f"load of the machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores"
    )


def main() -> None:
    """Print the times."""
    parser = argparse.ArgumentParser(description="How long a slider takes to become a picture.")
    parser.add_argument("log", nargs="?", type=Path, default=Path(str(files("experiments.demo") / "logs" / "wide.csv")))
    parser.add_argument("--browser", action="store_true", help="the whole way, in Chromium")
    asked = parser.parse_args()
    if asked.browser:
        print(f"{asked.log.name}: {told(in_browser(asked.log))}")
        return
    for effects in (0, 1, 3):
        found = measure(asked.log, Plant.resolve("table3"), effects)
        print(
            f"{asked.log.name}, {found.samples} samples in {found.seconds:.3g} s, {effects} effects: "
            f"picture {found.picture:.0f} ms (CPU {found.picture_cpu:.0f} ms), as JSON {found.to_json:.1f} ms, "
            f"numbers {found.numbers:.0f} ms more (CPU {found.numbers_cpu:.0f} ms)"
        )


if __name__ == "__main__":
    main()
