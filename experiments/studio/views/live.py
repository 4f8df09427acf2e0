"""The picture and the numbers of the view What if, which follow the sliders."""

from __future__ import annotations

import asyncio
import json
import math
import statistics
import time
from collections import deque
from dataclasses import dataclass
from typing import Any

from identification import PredictionWindow
from identification.validation.window import Picture, WindowPrediction

from .. import charts, commands
from ..frame import Frame, command_line, put_texts
from ..what_if import Choice, Start
from ..work import Latest, off_loop, sentence

REST = 1.2  # s without a change until the floor is measured anew
LATER = 0.25  # s without a change until the noise is fitted
SELDOM = 0.3  # s between two numbers while the hand moves on


@dataclass(frozen=True)
class Movement:
    """stamp [ms]: when the browser saw the hand move, by its clock. arrived [s]: when the server knew."""

    stamp: float
    arrived: float


@dataclass(frozen=True)
class Spent:
    """Where the time of one picture went on this side [ms]: until it was begun, computed, and written as JSON."""

    wait: float
    compute: float
    encode: float


class Live:
    """What this view keeps: the plant that is tried, the window it is tried on, and the parts of the page that move."""

    def __init__(self) -> None:
        self.choice: Choice | None = None
        self.start: Start | None = None
        self.window: PredictionWindow | None = None
        self.which, self.at = 0, 0.0
        self.last: WindowPrediction | None = None
        self.changes = 0
        self.chart: Any = None
        self.ratio: Any = None
        self.nats: Any = None
        self.detail: Any = None
        self.line: Any = None
        self.latest: Latest | None = None
        self.movement: Movement | None = None
        self.drawing: asyncio.Task[None] | None = None
        self.times: deque[float] = deque(maxlen=20)
        self.told = 0.0  # when the numbers were measured last


async def moved(frame: Frame, stamp: float | None = None) -> None:
    """Something was moved: show it at once, fit the noise when it rests, and measure the floor when it stays.

    stamp [ms]: when the browser saw a hand move, by its clock."""
    live = frame.of(Live)
    if live.latest is None:
        return
    if stamp is not None:
        live.movement = Movement(stamp, time.perf_counter())
    live.changes += 1
    mine = live.changes
    await live.latest.ask()
    await asyncio.sleep(LATER)
    if mine == live.changes:
        await compute(frame, live, settle=True)
    await asyncio.sleep(REST)
    if mine == live.changes:
        await _measure(frame, live, mine)


async def compute(frame: Frame, live: Live, settle: bool = False) -> None:
    """One picture of the plant as the sliders stand. settle: fit the noise to it."""
    assert live.choice is not None
    assert live.window is not None
    if live.drawing is not None:  # or this picture would wait for it, and be old when it is drawn
        await asyncio.wait({live.drawing})
    began = time.perf_counter()
    movement, live.movement = live.movement, None
    window = live.window
    try:
        picture = await off_loop(window.picture, live.choice.plant(), settle)
    except Exception as error:
        if live.detail is not None and not live.detail.is_deleted:  # the numbers before are of another plant
            put_texts({live.ratio: "—", live.nats: "—", live.detail: sentence(error)})
        return
    computed = time.perf_counter()
    if live.chart is None or live.chart.is_deleted:
        return
    series = charts.simulated(window.log.t, picture.angles)
    change = json.dumps({"series": series}, separators=(",", ":"))
    encoded = time.perf_counter()
    spent = None
    if movement is not None:
        spent = Spent(*(1e3 * s for s in (began - movement.arrived, computed - began, encoded - computed)))
    live.drawing = asyncio.create_task(_draw(frame, live, change, movement, spent))
    if not settle and began - live.told < SELDOM:
        return  # the hand moves on: the next picture comes first, and the numbers are told when it rests
    live.told = began
    await _numbers(frame, live, window, picture)


async def _numbers(frame: Frame, live: Live, window: PredictionWindow, picture: Picture) -> None:
    """Measure a picture of a window, and say the numbers."""
    try:
        measured = await off_loop(window.measured, picture)
    except Exception as error:
        put_texts({live.detail: sentence(error)})
        return
    if live.window is not window:  # its floor was measured anew meanwhile, and a picture of that follows
        return
    live.last = measured
    say(live, moving=not picture.settled)
    if picture.settled:
        say_command(frame, live)
        if not frame.noted:  # what was written stays in the footer until the hand moves again
            _say_times(frame, live, moving=False)


async def _draw(frame: Frame, live: Live, change: str, movement: Movement | None, spent: Spent | None) -> None:
    """Send the curves that have changed, and note what it took since the hand moved."""
    stamp = json.dumps(None if movement is None else movement.stamp)
    parts = json.dumps({} if spent is None else {k: round(v, 1) for k, v in vars(spent).items()})
    try:
        took = await live.chart.client.run_javascript(
            f"studio.draw({live.chart.id}, {change}, {stamp}, {parts})", timeout=2
        )
    except TimeoutError:
        return
    if isinstance(took, int | float):
        live.times.append(float(took))
        frame.noted = False
        _say_times(frame, live, moving=True)


def _say_times(frame: Frame, live: Live, moving: bool) -> None:
    """The footer: what the last pictures took."""
    if live.times and live.window is not None and frame.footer is not None and not frame.footer.is_deleted:
        text = (
            f"Slider to picture of {live.window.log.duration:.2g} s: {live.times[-1]:.0f} ms; "
            f"median of the last {len(live.times)}: {statistics.median(live.times):.0f} ms"
        )
        put_texts({frame.footer: text}, moving)


async def _measure(frame: Frame, live: Live, mine: int) -> None:
    """The floor as the plant that is shown measures it."""
    if live.window is None or live.choice is None or frame.doing:
        return
    try:
        plant = live.choice.plant()
        window = await off_loop(live.window.remeasured, plant)
    except Exception:  # a plant that loses the log measures no floor: the one before stays
        return
    if mine == live.changes:
        live.window = window
        await compute(frame, live, settle=True)
        if live.detail is not None and not live.detail.is_deleted:
            put_texts({live.detail: "1 is as good as noise allows; floor measured with this plant"})


def say(live: Live, moving: bool = False) -> None:
    """The error and the log-likelihood of the last picture. moving: while the hand moves."""
    if live.last is None or live.start is None or live.ratio is None or live.ratio.is_deleted:
        return
    if not math.isfinite(live.last.ratio_to_floor):
        texts = "lost", "—", "The filter of this plant loses the log: it is too far from the rig."
    else:
        gain = live.last.log_likelihood - live.start.log_likelihood
        texts = (
            f"{live.last.ratio_to_floor:.3g} ×",
            f"{gain:+.0f}".replace("-", "−"),
            "1 is as good as noise allows" + ("" if live.last.settled else "; moving"),
        )
    put_texts(dict(zip((live.ratio, live.nats, live.detail), texts, strict=True)), moving)


def say_command(frame: Frame, live: Live) -> None:
    """The command line that measures what the sliders show, where there is one."""
    if live.line is None or live.line.is_deleted or live.choice is None:
        return
    try:
        text = commands.what_if(frame.session, live.choice.plant())
    except ValueError:
        return
    live.line.clear()
    if not text:
        return
    with live.line:
        command_line(text)
