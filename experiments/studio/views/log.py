"""Log: drop files, see how they would be read, with a light for each part, and turn what is wrong."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Awaitable, Callable, Sequence
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

from nicegui import events, ui

from experiments.report.words import joined
from identification.logs.formats import READERS

from .. import LARGEST_FILE, MOST_FILES, charts, commands
from ..frame import Frame, command_line, drop_place, heading, light, message
from ..saved import ENDING, open_session
from ..work import off_loop, sentence
from ..written import write_mapping

if TYPE_CHECKING:
    from identification.logs.proposal import Item

SOON = 0.3  # s of reading until the page says that it reads
_BY_MOTION = "Read zero and signs as the motion shows them"
_LIGHTS = {"sure": ("good", "sure"), "likely": ("doubt", "likely"), "open": ("bad", "say it")}


def show(frame: Frame) -> None:
    session = frame.session
    with ui.row().classes("wrap-row"):
        label = f"Drop logs of one rig here ({', '.join(sorted(READERS))}), or a saved session ({ENDING})"
        refused = f"A file was refused. Expected at most {MOST_FILES} files of {LARGEST_FILE // 1_000_000} MB each."
        drop_place(frame, label, _dropped, refused, MOST_FILES)
        if not session.paths:
            ui.button("Open the demo's log", on_click=lambda: _demo(frame)).props("outline")
    if not session.paths or session.proposal is None:
        message("No log yet. Drop one, or start the page with it: furuta studio LOG")
        return
    if lost := session.computed:
        message(
            f"With another log, session or reading, this page forgets {joined(lost, 'and')}. To keep them, write "
            f"session{ENDING} in the view Export first.",
            "doubt",
        )
    heading("How it is read")
    with ui.row().classes("wrap-row"):
        for path, name in zip(session.paths, session.names, strict=True):
            ui.chip(name, removable=True, color="grey-4", text_color="black").on(
                "remove", lambda _, p=path: _remove(frame, p)
            )
    with ui.element("table").classes("table stacked"), ui.element("tbody"):
        against = _against(frame)
        for item in session.proposal.items:
            _row(frame, item, item.name in against)
    for problem in session.proposal.problems:
        message(_here(str(problem)), "bad" if problem.fatal else "doubt")
    if session.trouble and not session.proposal.fatal:
        message(_here(session.trouble), "bad")
    with ui.row().classes("wrap-row"):
        if (better := session.shown_by_motion()) is not None:
            mend = ui.button(_BY_MOTION, icon="auto_fix_high", on_click=lambda: _mend(frame, better))
            mend.mark("by-motion").set_enabled(not frame.doing)
        ready = bool(session.logs) and not session.proposal.fatal and not session.open_items
        if session.accepted:
            light("good", "These logs are used")
        else:
            use = ui.button("Use these logs", icon="check", on_click=lambda: _accept(frame))
            use.set_enabled(ready and not frame.doing)
        ui.button("Save rig.toml", on_click=lambda: _save(frame)).props("outline").set_enabled(ready)
    _preview(frame)
    command_line(commands.init(session))


def _here(text: str) -> str:
    """A sentence of the command line, as the page says it."""
    text = re.sub(r"read it with --pendulum-zero .*", f"press “{_BY_MOTION}”.", text)
    return text.replace("Name it: --columns ", "Choose it above, or on the command line: --columns ")


def _row(frame: Frame, item: Item, wrong: bool) -> None:
    state, word = _LIGHTS[item.confidence.value]
    if wrong:
        state, word = "bad", "wrong"
    with ui.element("tr").props(f'data-item="{item.name}"'):
        with ui.element("th").props("scope=row"):
            ui.label(item.says)
        with ui.element("td"):
            _control(frame, item)
        with ui.element("td"):
            light(state, word)
        with ui.element("td"):
            ui.label(item.reason)


def _control(frame: Frame, item: Item) -> None:
    if item.name.startswith("sign_"):
        ui.button(
            "turned" if item.value == "-" else "as it is",
            icon="swap_vert",
            on_click=lambda: _turn(frame, item.name[5:]),
        ).props(f'outline dense no-caps aria-label="Flip the {item.says}, now {item.shown}"').mark(
            f"flip-{item.name[5:]}"
        )
        return
    options = list(dict.fromkeys([*([item.shown] if item.shown != "?" else []), *item.alternatives]))
    if len(options) < 2 and item.shown != "?":
        ui.label(item.shown)
        return
    ui.select(
        options,
        value=item.shown if item.shown in options else None,
        with_input=True,
        new_value_mode="add-unique",
        on_change=lambda event: _say(frame, item, str(event.value or "")),
    ).props(f'dense outlined aria-label="{item.says}"').classes("choice").mark(f"item-{item.name}")


def _against(frame: Frame) -> set[str]:
    """Items that were said and that the motion contradicts."""
    session = frame.session
    better = session.shown_by_motion()
    if better is None or session.proposal is None:
        return set()
    now = {i.name[5:] for i in session.proposal.items if i.name.startswith("sign_") and i.value == "-"}
    wrong = {f"sign_{axis}" for axis in now ^ set(better.flip or ())}
    if session.proposal.item("pendulum_zero").value != better.pendulum_zero:
        wrong.add("pendulum_zero")
    return wrong


def _preview(frame: Frame) -> None:
    for log in frame.session.logs:
        heading(f"{log.source}: {len(log)} samples, {log.duration:.3g} s at {1e3 * log.sample_time:.3g} ms")
        chart = ui.echart(charts.log_panes(log.t, log.q1, log.q2, log.u, log.input_unit)).classes("chart tall")
        chart.mark("preview").props('role=img aria-label="The log as it is read: arm, pendulum, command over time"')
    for remark in frame.session.remarks:
        if remark not in {str(p) for p in frame.session.proposal.problems}:  # type: ignore[union-attr]
            message(_here(remark), "doubt")


def _failed(frame: Frame, text: str) -> None:
    frame.failure = text
    frame.show()


async def _dropped(frame: Frame, event: events.MultiUploadEventArguments) -> None:
    await _each(frame, [partial(_take, frame, file) for file in event.files])


async def _take(frame: Frame, file: ui.upload.FileUpload) -> None:
    if file.size() > LARGEST_FILE:  # before it is taken into memory
        _failed(frame, f"{file.name}: {file.size()} bytes. Expected at most {LARGEST_FILE}.")
    elif file.name.endswith(ENDING):
        await reopen(frame, file.name, await file.read())
    else:
        await _apply(frame, frame.session.drop, file.name, await file.read())


async def add(frame: Frame, paths: Sequence[Path]) -> None:
    """Take in the files that the command line names."""
    await _each(frame, [partial(_add, frame, path) for path in paths])


async def _each(frame: Frame, takes: Sequence[Callable[[], Awaitable[None]]]) -> None:
    """Take in one file after the other; what was wrong with one stays on the page when the next one is taken."""
    failures = []
    for take in takes:
        await take()
        failures += [frame.failure] if frame.failure else []
    if len(takes) > 1 and failures:
        _failed(frame, "\n".join(dict.fromkeys(failures)))


async def _add(frame: Frame, path: Path) -> None:
    if path.name.endswith(ENDING):
        if path.stat().st_size > LARGEST_FILE:
            _failed(frame, f"{path.name}: expected at most {LARGEST_FILE} bytes")
            return
        await reopen(frame, path.name, path.read_bytes())
        return
    await _apply(frame, frame.session.add, path)


async def reopen(frame: Frame, name: str, content: bytes) -> None:
    """Go on with a saved session in place of this one, which stays where the file holds none."""
    found = await frame.run("Opening the session", open_session, name, content, frame.session.folder)
    if found is not None:
        found.stated = frame.session.stated
        frame.session.close()
        frame.session = found
        frame.mark_saved()
        frame.reset()
        frame.show("Identify" if found.accepted else "Log")


async def _demo(frame: Frame) -> None:
    await _apply(frame, frame.session.add, Path(str(files("experiments.demo") / "logs" / "paper.csv")), False)


async def _apply(frame: Frame, change: Callable[..., None], *arguments: object) -> None:
    if frame.doing and not frame.lock.locked():  # while logs are read, what comes next waits for its turn
        _failed(frame, f"Wait until this is done: {frame.doing}")
        return
    async with frame.lock:
        frame.doing = "Reading the logs"
        telling = asyncio.get_running_loop().call_later(SOON, frame.show)
        try:
            await off_loop(change, *arguments)
        except Exception as error:
            failure = sentence(error)
        else:
            failure = ""
            frame.reset()
        telling.cancel()
        frame.doing = ""
        _failed(frame, failure)


async def _remove(frame: Frame, path: Path) -> None:
    await _apply(frame, frame.session.remove, path)


async def _turn(frame: Frame, axis: str) -> None:
    await _apply(frame, frame.session.turn, axis)


async def _say(frame: Frame, item: Item, answer: str) -> None:
    await _apply(frame, frame.session.say, item, answer)


async def _mend(frame: Frame, better: object) -> None:
    await _apply(frame, frame.session.mend, better)


def _accept(frame: Frame) -> None:
    try:
        frame.session.accept()
    except ValueError as error:
        _failed(frame, sentence(error))
        return
    frame.failure = ""
    frame.show("Identify")


def _save(frame: Frame) -> None:
    try:
        path = frame.session.target("rig.toml")
        said = write_mapping(frame.session, path)
    except (ValueError, OSError) as error:
        _failed(frame, sentence(error))
        return
    _failed(frame, said)
    frame.note(f"Written: {path}")
