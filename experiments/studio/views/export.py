"""Export: write results to the working folder, and the commands that repeat the session."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from functools import lru_cache, partial
from importlib.util import find_spec
from pathlib import Path

from nicegui import ui

from controllers import DesignError, export_c, export_mjcf, export_onnx, export_policy_c
from controllers.envelope import Envelope, unlimited
from controllers.learned.policy import load_to_export, not_trained_for
from controllers.registry import designed
from experiments.report import render
from experiments.report.diagnosis_page import diagnosis_page
from experiments.report.estimate_page import estimate_page
from furuta_gym.files import write_whole
from furuta_gym.plant import Plant
from identification.estimation.identifiability import spoken

from .. import commands
from ..frame import Frame, command_line, heading, message
from ..remarks import heard
from ..saved import ENDING, save_session
from ..session import Session
from ..written import write_mapping, write_plant

Writer = Callable[[Path], object]
"""Writes a file. A text that it gives is said on the page."""


def show(frame: Frame) -> None:
    session = frame.session
    if not session.accepted:
        message("First say how the logs are read: view Log, button “Use these logs”.")
        return
    heading(f"Write to {session.folder}")
    message("A file of the same name is replaced.")
    with ui.element("table").classes("table stacked"), ui.element("tbody"):
        for name, (meaning, writer) in offers(session).items():
            with ui.element("tr"):
                with ui.element("th").props("scope=row"):
                    ui.label(name)
                with ui.element("td"):
                    ui.label(meaning)
                with ui.element("td"):
                    button = ui.button("Write", on_click=partial(_write, frame, name, writer))
                    button.props(f'outline dense aria-label="Write {name}"').mark(f"write-{name}")
    if session.found is not None and session.examination is None:
        message(
            "The report of the diagnosis is not here: a saved session keeps the verdict only. To make the report "
            f"again, press “Search again” in the view Diagnose, or run: {commands.diagnose(session)}"
        )
    if session.policy is None:
        message("A policy goes to ONNX and C once it was dropped in view Play, “Closed loop”.")
    heading("The same as a script")
    command_line("\n".join(steps(session)))


def best(session: Session) -> Plant | None:
    """The plant to use: kept in What if, else found by the diagnosis, else identified."""
    found = session.found.plant if session.found else None
    return session.kept or found or (session.estimate.plant if session.estimate else None)


def told(session: Session) -> str:
    """What that plant is."""
    if session.kept is not None:
        if moved := session.kept.moved_by_hand:
            return f"the plant that was moved by hand in What if ({spoken(moved)}); it is no fit and has no error bars"
        return "the plant that was kept in What if, with its effects"
    return "the plant of the diagnosis" if session.found and session.found.plant else "the identified plant"


def plant_file(session: Session) -> str:
    """Where the commands of the session leave that plant."""
    return "what_if.json" if session.kept else "diagnosis/plant.json" if session.found else "rig.json"


def offers(session: Session) -> dict[str, tuple[str, Writer]]:
    """What can be written now: by file name, its meaning and who writes it."""
    pages = find_spec("jinja2") is not None and find_spec("plotly") is not None
    found: dict[str, tuple[str, Writer]] = {}
    proposal, estimate, examination, plant = session.proposal, session.estimate, session.examination, best(session)
    if proposal is not None:
        found["rig.toml"] = ("how the logs are read", partial(write_mapping, session))
    if estimate is not None:
        found["rig.json"] = ("the identified plant", partial(write_plant, estimate.plant))
        if pages:
            page = lambda: render(estimate_page(estimate, session.logs, session.gap, session.gap_remark, "rig.json"))  # noqa: E731
            found["identify.html"] = ("the report of the fit", lambda path: write_whole(path, page()))
    if examination is not None and pages:
        text = lambda: render(diagnosis_page(examination))  # noqa: E731
        found["report.html"] = ("the report of the diagnosis", lambda path: write_whole(path, text()))
    if session.kept is not None:
        found[plant_file(session)] = (f"{told(session)}; the script names it so", partial(write_plant, session.kept))
    if plant is not None:
        found["plant.json"] = (told(session), partial(write_plant, plant))
        if law := holds(plant):
            found["controller.h"] = (f"{law}, which holds this plant, as C for firmware", partial(_controller, plant))
        found["plant.xml"] = ("this plant for MuJoCo", lambda path: export_mjcf(plant, path))
        if session.policy is not None and session.policy.exists():
            name = session.policy.name
            found["policy.onnx"] = (f"the policy {name} as ONNX", partial(_onnx, session, plant))
            found["policy.h"] = (f"the policy {name} as C for firmware", partial(_policy, session, plant))
    if session.paths:
        found[f"session{ENDING}"] = (
            "this session: its logs, how they are read, and what was found; drop it in view Log to go on",
            lambda path: save_session(session, path),
        )
    found["session.sh"] = (
        "the commands below",
        lambda path: write_whole(path, commands.script(session, steps(session))),
    )
    return found


def steps(session: Session) -> list[str]:
    """The commands that repeat the session."""
    lines = [commands.init(session)]
    if session.estimate is not None:
        lines += [commands.identify(session), commands.validate(session)]
    if session.found is not None:
        lines.append(commands.diagnose(session))
    if (plant := best(session)) is not None:
        file = plant_file(session)
        if session.kept is not None:
            lines.append(f"# {file}: the plant that was kept in the view What if; the view Export writes it")
        if law := holds(plant):
            lines.append(f"furuta export {file} --controller {law} -o controller.h")
        lines.append(f"furuta export {file} -o plant.xml")
        if (policy := session.policy) is not None:
            trust = " --trust" if session.trusted else ""
            lines.append(f"furuta export {file} {shlex.quote(policy.name)}{trust} -o policy.onnx")
            lines.append(f"furuta export {file} {shlex.quote(policy.name)}{trust} -o policy.h")
    return lines


@lru_cache(maxsize=8)
def holds(plant: Plant) -> str | None:
    """The name of a controller that holds a plant; None where none of the usual ones does."""
    try:
        return designed(plant).name
    except DesignError:
        return None


def _controller(plant: Plant, path: Path) -> str:
    export_c(designed(plant), path)
    return unlimited(plant)


def _onnx(session: Session, plant: Plant, path: Path) -> str:
    export_onnx(str(session.policy), plant, path, trust=session.trusted)
    return not_trained_for(str(session.policy), plant)


def _policy(session: Session, plant: Plant, path: Path) -> str:
    policy = load_to_export(str(session.policy), plant, trust=session.trusted)
    export_policy_c(policy, path)
    return ". ".join(
        filter(None, (unlimited(plant, Envelope.of(policy).arm_travel), not_trained_for(str(session.policy), plant)))
    )


async def _write(frame: Frame, name: str, writer: Writer) -> None:
    said = await frame.run(f"Writing {name}", _written, frame.session, name, writer)
    if said is None:
        return
    frame.note(f"Written: {frame.session.folder / name}")
    if name.endswith(ENDING):
        frame.mark_saved()
    if said:
        frame.failure = said
    frame.show()


def _written(session: Session, name: str, writer: Writer) -> str:
    with heard() as remarks:
        said = writer(session.target(name))
    texts = said if isinstance(said, str) else ""
    return ". ".join(filter(None, (texts, *(remark for remark in remarks if remark not in texts))))
