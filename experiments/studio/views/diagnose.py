"""Diagnose: the search for the missing effect as it runs, and its verdict in physical words."""

from __future__ import annotations

import re
import time
from collections.abc import Sequence

from nicegui import ui

from experiments.report.examination import Examination, examine
from experiments.report.verdict import verdict
from furuta_gym.plant import EFFECTS, Plant
from identification import Log, diagnose

from .. import charts, commands
from ..frame import Frame, command_line, heading, message, number_card
from ..work import Job

MOST = 3


class Search:
    """What this view keeps: the job and when it began."""

    def __init__(self) -> None:
        self.job = Job()
        self.began = 0.0


def show(frame: Frame) -> None:
    session = frame.session
    if not session.accepted:
        message("First say how the logs are read: view Log, button “Use these logs”.")
        return
    search = frame.of(Search)
    if search.job.running:
        _running(frame, search)
    elif session.examination is not None:
        _found(frame, session.examination)
    else:
        if search.job.cancelled:
            message("Stopped. This is what was known:", "doubt")
            _known(search)
        else:
            message(
                "The library is searched for an effect that these logs need. It takes some minutes for 20 s of log."
            )
        ui.button("Diagnose", icon="search", on_click=lambda: run(frame)).mark("run-diagnose").set_enabled(
            not frame.doing
        )
    command_line(commands.diagnose(session))


async def run(frame: Frame) -> None:
    """Search, and show the verdict."""
    search, session = frame.of(Search), frame.session
    search.job, search.began = Job(running=True), time.monotonic()
    job = search.job
    found = await frame.run("Searching the library of effects", _diagnose, session.logs, job)
    job.running = False
    if found is not None and frame.of(Search) is search:
        session.examination = found
    frame.show()


def _diagnose(logs: Sequence[Log], job: Job) -> Examination:
    return examine(diagnose(logs, most=MOST, progress=job.tell), logs, progress=job.tell)


def _running(frame: Frame, search: Search) -> None:
    with ui.row().classes("wrap-row"):
        ui.button("Stop and keep what is known", icon="stop", on_click=lambda: _stop(frame, search)).props("outline")
    place = ui.element("div")
    shown = {"steps": -1}

    def refresh() -> None:
        if place.is_deleted or len(search.job.steps) == shown["steps"]:
            return
        shown["steps"] = len(search.job.steps)
        place.clear()
        with place:
            _known(search)

    refresh()
    ui.timer(0.5, refresh)


def _stop(frame: Frame, search: Search) -> None:
    search.job.cancel()
    frame.doing = "Stopping after this step; what is known stays"
    frame.show()


def _known(search: Search) -> None:
    """The steps, and of the effects that were looked at those that are still in."""
    steps = search.job.steps
    tried = [names for step in steps if (names := _names(step))]
    if tried:
        every = list(dict.fromkeys(name for names in tried for name in names))
        inside = tried[-1]
        out = [name for name in every if name not in inside]
        heading("Suspects")
        with ui.element("ul"):
            for name in inside:
                with ui.element("li"):
                    ui.label(f"{EFFECTS[name].title} ({name}): in the present step")
        if out:
            ui.label(f"Looked at before: {', '.join(out)}").classes("card-meaning")
    heading("Steps")
    with ui.element("ol").classes("steps"):
        for step in steps:
            with ui.element("li"):
                ui.label(step)


def _names(step: str) -> list[str]:
    return [word for word in re.findall(r"[a-z_0-9]+", step) if word in EFFECTS]


def _found(frame: Frame, examination: Examination) -> None:
    found = examination.diagnosis
    said = verdict(found, examination.next_experiment)
    state = "good" if said.good else "bad" if found.verdict in ("unknown", "insufficient_excitation") else "doubt"
    heading("Verdict")
    with ui.element("div").classes(f"verdict verdict-{state}").mark("verdict"):
        ui.label(said.badge).classes("verdict-label")
        ui.label(said.headline).classes("verdict-text")
    for text in said.doubts:
        message(text, "doubt")
    with ui.element("div").classes("cards"):
        for fact in said.facts:
            number_card(fact.name, fact.value, fact.meaning)
    message(f"Next: {said.next}")
    ranking = found.naming.rankings[0][:8] if found.naming and found.naming.rankings else ()
    if ranking:
        heading("What each effect alone would explain")
        names = [EFFECTS[s.name].title for s in ranking]
        chart = ui.echart(charts.bars(names, [s.net for s in ranking], "nats gained, less their price")).classes(
            "chart"
        )
        chart.props('role=img aria-label="Log-likelihood that each effect alone gains"')
    with ui.row().classes("wrap-row"):
        ui.button("Move it in What if", icon="tune", on_click=lambda: _move(frame, found.plant)).set_enabled(
            found.plant is not None and frame.session.estimate is not None
        )
        ui.button("Search again", on_click=lambda: run(frame)).props("outline")


def _move(frame: Frame, plant: Plant | None) -> None:
    from .what_if import Live

    frame.session.kept = plant
    frame.state.pop(Live, None)
    frame.show("What if")
