"""What if: move θ and effects, and see simulation meet measurement while they move."""

from __future__ import annotations

import asyncio
import json
import math
import statistics
import time
from dataclasses import dataclass
from functools import partial
from typing import Any

from nicegui import ui

from furuta_gym.plant import Effect, Plant
from furuta_gym.plant.parameters import THETA_MEANING
from identification import PredictionWindow
from identification.validation.window import WindowPrediction

from .. import charts, commands
from ..frame import Frame, command_line, heading, message
from ..what_if import NAMES, Choice, Range, Start, addable, fitted, moved_by_hand, prepare
from ..work import Latest, off_loop, sentence

REST = 1.2  # s without a change until the floor is measured anew
LATER = 0.25  # s without a change until the noise is fitted
SELDOM = 0.3  # s between two numbers while the hand moves on
OFTEN = 0.02  # s between two positions of a slider that moves


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
        self.stamp: float | None = None  # when the browser saw the hand move, by its clock [ms]
        self.drawing: asyncio.Task[None] | None = None
        self.times: list[float] = []
        self.told, self.noted = 0.0, 0.0  # when the numbers were measured last, and the footer written


def show(frame: Frame) -> None:
    session = frame.session
    if session.estimate is None:
        message("First fit the model: view Identify.")
        return
    live = frame.of(Live)
    if live.choice is None:
        live.choice = Choice(session.kept or session.estimate.plant)
    if live.start is None:
        message("The noise floor of a stretch of 5 s is measured once; then every slider answers at once.")
        ui.button("Start", icon="play_arrow", on_click=lambda: begin(frame)).set_enabled(not frame.doing)
        return
    with ui.element("div").classes("split"):
        with ui.element("div").classes("split-main"):
            _picture(frame, live)
        with ui.element("div").classes("split-side"):
            _effects(frame, live)
            _theta(frame, live)
    with ui.element("div").classes("full"):
        live.line = ui.element("div")
    _say_command(frame, live)


async def begin(frame: Frame) -> None:
    """Measure the window and show the picture."""
    live, session = frame.of(Live), frame.session
    assert session.estimate is not None
    base = session.estimate.plant
    arguments = (base, session.logs, session.estimate.zeros, live.which, live.at)
    start = await frame.run("Measuring the noise floor of the window", prepare, *arguments)
    if start is None:
        return
    live.start, live.window = start, start.window
    live.latest = Latest(partial(_compute, frame, live))
    live.last = None
    frame.show("What if")
    await moved(frame)


def _picture(frame: Frame, live: Live) -> None:
    assert live.window is not None
    log = live.window.log
    with ui.element("div").classes("readout").props("role=status aria-live=off"):
        with ui.element("div").classes("card"):
            ui.label("Error over noise floor").classes("card-title")
            live.ratio = ui.label("…").classes("card-value").mark("ratio")
            live.detail = ui.label("").classes("card-meaning").mark("detail")
        with ui.element("div").classes("card"):
            ui.label("Log-likelihood").classes("card-title")
            live.nats = ui.label("…").classes("card-value").mark("nats")
            ui.label("nats against the identified plant").classes("card-meaning")
    angles = live.last.angles if live.last is not None else log.angles * math.nan
    live.chart = ui.echart(charts.overlay(log.t, log.angles, angles)).classes("chart live")
    live.chart.props('role=img aria-label="Simulated over measured readings of arm and pendulum"')
    message(
        f"Every {live.window.horizon:g} s the simulation starts anew from the filter's state, because the upright "
        "pendulum falls in any simulation."
    )
    _tell(live)
    with ui.row().classes("wrap-row"):
        logs = {i: log.source for i, log in enumerate(frame.session.logs)}
        ui.select(logs, value=live.which, label="Log", on_change=lambda e: _window(frame, which=int(e.value)))
        longest = max(0.0, frame.session.logs[live.which].duration - 5.0)
        ui.number(
            "Window from [s]", value=live.at, min=0, max=longest, step=1, on_change=lambda e: _window(frame, at=e.value)
        ).props("debounce=700")
        ui.button("Reset", icon="restart_alt", on_click=lambda: _reset(frame)).props("outline")
        ui.button("Fit this one", icon="auto_fix_high", on_click=lambda: _fit(frame)).props("outline")
        ui.button("Keep as plant", icon="save", on_click=lambda: _keep(frame)).props("outline")


def _effects(frame: Frame, live: Live) -> None:
    choice = live.choice
    assert choice is not None
    heading("Effects")
    ui.select(
        addable(choice), label="Add an effect", with_input=True, on_change=lambda e: _add(frame, e.value)
    ).classes("wide").mark("add-effect")
    for name, values in choice.effects.items():
        kind = Effect(name).type
        with ui.element("div").classes("effect").mark(f"effect-{name}"):
            with ui.row().classes("effect-title"):
                ui.switch(
                    kind.title,
                    value=name not in choice.off,
                    on_change=lambda e, n=name: _switch(frame, n, bool(e.value)),
                )
                ui.button(icon="close", on_click=lambda _, n=name: _remove(frame, n)).props(
                    f'flat dense aria-label="Remove {kind.title}"'
                )
            ui.label(f"{name}: {kind.equation}").classes("card-meaning")
            for parameter in moved_by_hand(kind, values):
                unit = parameter.unit.format(u=choice.base.unit)
                _slider(
                    frame,
                    f"{parameter.name} [{unit}]" if unit else parameter.name,
                    parameter.meaning,
                    values[parameter.name],
                    choice.effect_range(name, parameter),
                    partial(_set_effect, choice, name, parameter.name, parameter.integer),
                    f"{name}.{parameter.name}",
                )


def _theta(frame: Frame, live: Live) -> None:
    choice = live.choice
    assert choice is not None
    heading("Parameters of model (5)")
    for i, name in enumerate(NAMES):
        meaning, unit = THETA_MEANING[name]
        title = f"θ{i + 1} [{unit.format(u=choice.base.unit)}]"
        _slider(frame, title, meaning, choice.theta[i], choice.theta_range(i), partial(_set_theta, choice, i), name)


def _slider(frame: Frame, title: str, meaning: str, value: float, span: Range, put: Any, mark: str) -> None:
    """A slider and a number beside it, for the same value. A movement of the hand comes with the browser's time."""
    at = _At(value)

    def show(other: Any) -> None:
        at.busy = True
        other.set_value(float(f"{at.value:.5g}"))
        at.busy = False

    async def follow(wanted: float) -> None:
        await asyncio.sleep(LATER)
        if at.value == wanted and not box.is_deleted:
            show(box)

    async def take(wanted: float, by_number: bool) -> None:
        if wanted == at.value:
            return
        at.value = wanted
        put(wanted)
        if by_number:
            show(slider)
        else:  # the browser draws the whole page anew for every number that changes: it has to wait for the picture
            at.following = asyncio.create_task(follow(wanted))
        await moved(frame)

    async def grabbed(event: Any) -> None:
        wanted, stamp = event.args
        if wanted is not None:
            frame.of(Live).stamp = float(stamp)
            await take(float(wanted), False)

    async def change(event: Any) -> None:
        if event.value is not None and not at.busy:
            await take(float(event.value), event.sender is box)

    with ui.element("div").classes("slider"):
        ui.label(title).classes("slider-title")
        ui.label(meaning).classes("card-meaning")
        with ui.row().classes("slider-row"):
            slider = (
                _Slider(
                    min=min(span.low, value),
                    max=max(span.high, value),
                    step=span.step,
                    value=value,
                    on_change=change,
                )
                .props(f'aria-label="{title}: {meaning}"')
                .classes("slider-track")
                .mark(f"slider-{mark}")
            )
            slider.on(
                "update:model-value",
                grabbed,
                throttle=OFTEN,
                js_handler="(value) => emit(value, performance.now())",
            )
            box = (
                ui.number(value=float(f"{value:.5g}"), on_change=change, format="%.4g")
                .props(f'dense outlined debounce=300 aria-label="{title}, as a number" step=any')
                .classes("slider-number")
                .mark(f"number-{mark}")
            )


class _Slider(ui.slider):
    """A slider that the browser moves by itself."""

    LOOPBACK = False


@dataclass
class _At:
    """What a slider and its number show. busy: while one of them follows the other; following: when it rests."""

    value: float
    busy: bool = False
    following: asyncio.Task[None] | None = None


def _set_theta(choice: Choice, i: int, value: float) -> None:
    choice.theta[i] = value


def _set_effect(choice: Choice, name: str, parameter: str, whole: bool, value: float) -> None:
    choice.effects[name][parameter] = float(round(value)) if whole else value


async def moved(frame: Frame) -> None:
    """Something was moved: show it at once, fit the noise when it rests, and measure the floor when it stays."""
    live = frame.of(Live)
    if live.latest is None:
        return
    live.changes += 1
    mine = live.changes
    await live.latest.ask()
    await asyncio.sleep(LATER)
    if mine == live.changes:
        await _compute(frame, live, settle=True)
    await asyncio.sleep(REST)
    if mine == live.changes:
        await _measure(frame, live, mine)


async def _compute(frame: Frame, live: Live, settle: bool = False) -> None:
    assert live.choice is not None
    assert live.window is not None
    began = time.perf_counter()
    stamp, live.stamp = live.stamp, None
    window = live.window
    try:
        picture = await off_loop(window.picture, live.choice.plant(), settle)
    except Exception as error:
        if live.detail is not None and not live.detail.is_deleted:
            live.detail.set_text(sentence(error))
        return
    computed = time.perf_counter() - began
    if live.chart is None or live.chart.is_deleted:
        return
    if live.drawing is not None:  # one picture on its way at a time, while the next one is computed
        await asyncio.wait({live.drawing})
    series = charts.simulated(window.log.t, picture.angles)
    live.drawing = asyncio.create_task(_draw(frame, live, series, stamp, computed))
    live.chart.options["series"][:2] = [
        old | new for old, new in zip(live.chart.options["series"][:2], series, strict=True)
    ]
    if not settle and began - live.told < SELDOM:
        return  # the hand moves on: the next picture comes first, and the numbers are told when it rests
    live.told = began
    try:
        live.last = await off_loop(window.measured, picture)
    except Exception as error:
        live.detail.set_text(sentence(error))
        return
    _tell(live)
    if settle:
        _say_command(frame, live)


async def _draw(frame: Frame, live: Live, series: list[dict[str, Any]], stamp: float | None, computed: float) -> None:
    """Send the curves that have changed, and note what it took since the hand moved."""
    change = json.dumps({"series": series}, separators=(",", ":"))
    try:
        took = await live.chart.client.run_javascript(
            f"studio.draw({live.chart.id}, {change}, {json.dumps(stamp)})", timeout=2
        )
    except TimeoutError:
        return
    if isinstance(took, int | float):
        live.times = [*live.times[-19:], float(took)]
        assert live.window is not None
        if time.perf_counter() - live.noted < SELDOM:
            return
        live.noted = time.perf_counter()
        frame.note(
            f"Slider to picture: {took:.0f} ms, of which {1e3 * computed:.0f} ms to compute "
            f"{live.window.log.duration:.2g} s; median of the last {len(live.times)}: "
            f"{statistics.median(live.times):.0f} ms"
        )


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
        await _compute(frame, live, settle=True)
        if live.detail is not None and not live.detail.is_deleted:
            live.detail.set_text("1 is as good as noise allows; floor measured with this plant")


def _tell(live: Live) -> None:
    if live.last is None or live.start is None or live.ratio is None or live.ratio.is_deleted:
        return
    if not math.isfinite(live.last.ratio_to_floor):
        live.ratio.set_text("lost")
        live.nats.set_text("—")
        live.detail.set_text("The filter of this plant loses the log: it is too far from the rig.")
        return
    live.ratio.set_text(f"{live.last.ratio_to_floor:.3g} ×")
    gain = live.last.log_likelihood - live.start.log_likelihood
    live.nats.set_text(f"{gain:+.0f}".replace("-", "−"))
    live.detail.set_text("1 is as good as noise allows" + ("" if live.last.settled else "; moving"))


def _say_command(frame: Frame, live: Live) -> None:
    if live.line is None or live.line.is_deleted or live.choice is None:
        return
    try:
        text = commands.what_if(frame.session, live.choice.plant())
    except ValueError:
        return
    live.line.clear()
    with live.line:
        command_line(text)


async def _redraw(frame: Frame) -> None:
    frame.failure = ""
    frame.show("What if")
    await moved(frame)


async def _window(frame: Frame, which: int | None = None, at: float | None = None) -> None:
    live = frame.of(Live)
    if which is not None:
        live.which, live.at = which, 0.0
    if at is not None:
        live.at = float(at)
    await begin(frame)


async def _add(frame: Frame, name: str | None) -> None:
    live = frame.of(Live)
    if name is not None and live.choice is not None:
        live.choice.add(name)
        await _redraw(frame)


async def _remove(frame: Frame, name: str) -> None:
    live = frame.of(Live)
    assert live.choice is not None
    live.choice.remove(name)
    await _redraw(frame)


async def _switch(frame: Frame, name: str, on: bool) -> None:
    live = frame.of(Live)
    assert live.choice is not None
    (live.choice.off.discard if on else live.choice.off.add)(name)
    await moved(frame)


async def _reset(frame: Frame) -> None:
    live = frame.of(Live)
    assert live.choice is not None
    live.choice.reset()
    await _redraw(frame)


async def _fit(frame: Frame) -> None:
    """θ and the effects that act, fitted together to all logs."""
    live = frame.of(Live)
    assert live.choice is not None
    plant: Plant | None = await frame.run(
        "Fitting θ and these effects to all logs", fitted, frame.session.logs, live.choice
    )
    if plant is not None:
        live.choice.take(plant)
        await _redraw(frame)


def _keep(frame: Frame) -> None:
    live = frame.of(Live)
    assert live.choice is not None
    try:
        frame.session.kept = live.choice.plant()
        path = frame.session.kept.save(frame.session.target("what_if.json"))
    except (ValueError, OSError) as error:
        frame.failure = sentence(error)
        frame.show()
        return
    frame.note(f"Written: {path}")
    _say_command(frame, live)
