"""Diagnose: the search for the missing effect as it runs, and its verdict in physical words."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path

from nicegui import ui

from experiments.report.examination import Examination, examine
from experiments.report.verdict import verdict
from furuta_gym.plant import EFFECTS, Plant
from identification import Log, diagnose
from identification.diagnosis.watched import Tried

from .. import charts, commands
from ..frame import Frame, cells, command_line, heading, light, message, number_card
from ..session import Found
from ..suspects import Suspect, best_plant, suspects
from ..work import Job


class Search:
    """What this view keeps: the job, and what it has tried."""

    def __init__(self) -> None:
        self.job = Job()
        self.tried: list[Tried] = []


def show(frame: Frame) -> None:
    session = frame.session
    if not session.accepted:
        message("First say how the logs are read: view Log, button “Use these logs”.")
        return
    search = frame.of(Search)
    if search.job.running:
        _running(frame, search)
    elif session.found is not None:
        _found(frame, session.found)
    else:
        _before(frame, search)
    command_line(commands.diagnose(session))


def _before(frame: Frame, search: Search) -> None:
    if search.job.cancelled:
        message("Stopped. This is what was known; the search goes on from here.", "doubt")
        _known(search)
    elif frame.session.journal.exists():
        message("A search of these logs was stopped. It goes on from the fits that it has made.")
    else:
        message("The library is searched for an effect that these logs need. It takes some minutes for 20 s of log.")
    with ui.row().classes("wrap-row"):
        text = "Go on" if search.job.cancelled or frame.session.journal.exists() else "Diagnose"
        ui.button(text, icon="search", on_click=lambda: run(frame)).mark("run-diagnose").set_enabled(not frame.doing)
        plant = best_plant(search.tried)
        if plant is not None and frame.session.estimate is not None:
            ui.button("Move the best so far in What if", icon="tune", on_click=lambda: _move(frame, plant)).props(
                "outline"
            ).set_enabled(not frame.doing)


async def run(frame: Frame) -> None:
    """Search, and show the verdict."""
    search, session = frame.of(Search), frame.session
    search.job = Job(running=True)
    job = search.job
    found = await frame.run(
        "Searching the library of effects",
        _diagnose,
        session.logs,
        job,
        session.journal,
        search.tried.append,
        job=job,
    )
    job.running = False
    if found is not None and frame.of(Search) is search:
        session.examination, session.found = found, shown(found)
    frame.show()


def _diagnose(logs: Sequence[Log], job: Job, journal: Path, keep: Callable[[Tried], None]) -> Examination:
    def watch(tried: Tried) -> None:
        keep(tried)
        job.check()

    def tell(step: str) -> None:
        kept = str(journal) in step  # a file that nobody knows of who looks at the page
        job.tell("what the search that was stopped has fitted is not fitted again" if kept else step)

    found = diagnose(logs, progress=tell, journal=journal, watch=watch)
    return examine(found, logs, progress=job.tell)


def shown(examination: Examination) -> Found:
    """What the page shows of a diagnosis."""
    found = examination.diagnosis
    said = verdict(found, examination.next_experiment)
    state = "good" if said.good else "bad" if found.verdict in ("unknown", "insufficient_excitation") else "doubt"
    ranking = found.naming.rankings[0][:8] if found.naming and found.naming.rankings else ()
    return Found(
        said.with_blocks(()), state, tuple((EFFECTS[s.name].title, float(s.net)) for s in ranking), found.plant
    )


def _running(frame: Frame, search: Search) -> None:
    with ui.row().classes("wrap-row"):
        stop = ui.button("Stop and keep what is known", icon="stop", on_click=lambda: _stop(frame, search))
        stop.props("outline").set_enabled(not search.job.cancelled)
    place = ui.element("div")
    at = {"steps": (-1, -1)}

    def refresh() -> None:
        now = len(search.job.steps), len(search.tried)
        if place.is_deleted or now == at["steps"]:
            return
        at["steps"] = now
        place.clear()
        with place:
            _known(search)

    refresh()
    ui.timer(0.5, refresh)


def _stop(frame: Frame, search: Search) -> None:
    search.job.cancel()
    frame.doing = "Stopping after this fit; what is known stays"
    frame.show()


def _known(search: Search) -> None:
    """The suspects with what each explains so far, and the steps."""
    steps = search.job.steps
    now = next((names for step in reversed(steps) if (names := _names(step))), [])
    if table := suspects(search.tried, now):
        heading("Suspects")
        with ui.element("div").classes("scroll"), ui.element("table").classes("table suspects").mark("suspects"):
            with ui.element("thead"), ui.element("tr"):
                cells(["effect", "gain so far [nats]", "together with", ""], "th")
            with ui.element("tbody"):
                for suspect in table:
                    _row(suspect)
    heading("Steps")
    with ui.element("ol").classes("steps"):
        for step in steps:
            with ui.element("li"):
                ui.label(step)


def _row(suspect: Suspect) -> None:
    with ui.element("tr").props(f'data-suspect="{suspect.name}"'):
        with ui.element("th").props("scope=row"):
            ui.label(f"{EFFECTS[suspect.name].title} ({suspect.name})")
        gain = "" if suspect.gain is None else f"{suspect.gain:+.0f}".replace("-", "−")
        cells([gain, ", ".join(suspect.beside)])
        with ui.element("td"):
            if suspect.tried_now:
                light("doubt", "being fitted")
            elif suspect.out:
                light("none", f"out: {suspect.behind:.0f} nats behind")
            else:
                light("good", "in")


def _names(step: str) -> list[str]:
    return [word for word in re.findall(r"[a-z_0-9]+", step) if word in EFFECTS]


def _found(frame: Frame, found: Found) -> None:
    said = found.verdict
    heading("Verdict")
    with ui.element("div").classes(f"verdict verdict-{found.state}").mark("verdict"):
        ui.label(said.badge).classes("verdict-label")
        ui.label(said.headline).classes("verdict-text")
    for text in said.doubts:
        message(text, "doubt")
    with ui.element("div").classes("cards"):
        for fact in said.facts:
            number_card(fact.name, fact.value, fact.meaning)
    message(f"Next: {said.next}")
    if found.ranking:
        heading("What each effect alone would explain")
        names, gains = [name for name, _ in found.ranking], [gain for _, gain in found.ranking]
        chart = ui.echart(charts.bars(names, gains, "nats gained, less their price")).classes("chart")
        chart.props('role=img aria-label="Log-likelihood that each effect alone gains"')
    with ui.row().classes("wrap-row"):
        ui.button("Move it in What if", icon="tune", on_click=lambda: _move(frame, found.plant)).set_enabled(
            found.plant is not None and frame.session.estimate is not None
        )
        ui.button("Search again", on_click=lambda: run(frame)).props("outline").set_enabled(not frame.doing)


def _move(frame: Frame, plant: Plant | None) -> None:
    from .live import Live

    frame.session.kept = plant
    frame.state.pop(Live, None)
    frame.show("What if")
