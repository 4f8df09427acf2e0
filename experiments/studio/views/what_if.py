"""What if: move θ and effects, and see simulation meet measurement while they move."""

from __future__ import annotations

import math
from functools import partial

from nicegui import ui

from furuta_gym.plant import Plant

from .. import charts
from ..frame import Frame, message
from ..session import Session
from ..what_if import Choice, fitted, prepare
from ..work import Job, Latest, sentence
from ..written import write_plant
from .live import Live, compute, moved, say, say_command
from .sliders import Sliders


def show(frame: Frame) -> None:
    session = frame.session
    if session.estimate is None:
        message("First fit the model: view Identify.")
        return
    live = frame.of(Live)
    if live.choice is None:
        live.choice = choice_of(session)
    if live.start is None:
        message("The noise floor of a stretch of 5 s is measured once; then every slider answers at once.")
        ui.button("Start", icon="play_arrow", on_click=lambda: begin(frame)).set_enabled(not frame.doing)
        return
    with ui.element("div").classes("split"):
        with ui.element("div").classes("split-main"):
            _picture(frame, live)
        with ui.element("div").classes("split-side"):
            sliders = Sliders(live.choice, partial(moved, frame), partial(_redraw, frame))
            sliders.effects()
            sliders.theta()
    with ui.element("div").classes("full"):
        live.line = ui.element("div")
    say_command(frame, live)


def choice_of(session: Session) -> Choice:
    """The plant that was kept, with a fit to go back to: the diagnosis's where that is moved, else model (5)."""
    assert session.estimate is not None
    found, kept = session.found.plant if session.found else None, session.kept
    choice = Choice(found if found is not None and kept == found else session.estimate.plant)
    if kept is not None:
        choice.take(kept)
    return choice


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
    live.latest = Latest(partial(compute, frame, live))
    live.last = None
    frame.show()  # whoever went to another view meanwhile stays there
    await moved(frame)


def _picture(frame: Frame, live: Live) -> None:
    assert live.window is not None
    log = live.window.log
    with ui.element("div").classes("readout").props("role=status aria-live=off"):
        with ui.element("div").classes("card"):
            ui.label("Gap, times the noise floor").classes("card-title")
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
    say(live)
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


async def _redraw(frame: Frame) -> None:
    frame.failure = ""
    frame.show()
    await moved(frame)


async def _window(frame: Frame, which: int | None = None, at: float | None = None) -> None:
    live = frame.of(Live)
    before, start = (live.which, live.at), live.start
    if which is not None:
        live.which, live.at = which, 0.0
    if at is not None:
        live.at = float(at)
    await begin(frame)
    if live.start is start:  # there is no such window: the one that is shown stays
        live.which, live.at = before
        frame.show()


async def _reset(frame: Frame) -> None:
    live = frame.of(Live)
    assert live.choice is not None
    live.choice.reset()
    if live.start is not None:  # the floor that another plant measured says nothing of the fit
        live.window = live.start.window
    await _redraw(frame)


async def _fit(frame: Frame) -> None:
    """θ and the effects that act, fitted together to all logs."""
    live = frame.of(Live)
    assert live.choice is not None
    job = Job()
    plant: Plant | None = await frame.run(
        "Fitting θ and these effects to all logs", fitted, frame.session.logs, live.choice, job.pool, job=job
    )
    if plant is not None:
        live.choice.take(plant)
        await _redraw(frame)


def _keep(frame: Frame) -> None:
    live = frame.of(Live)
    assert live.choice is not None
    try:
        frame.session.kept = live.choice.plant()
        path = frame.session.target("what_if.json")
        frame.failure = write_plant(frame.session.kept, path)
    except (ValueError, OSError) as error:
        frame.failure = sentence(error)
    else:
        frame.note(f"Written: {path}")
    if frame.failure:
        frame.show()
    frame.tell_browser()
    say_command(frame, live)
