"""Identify: is the model adequate, θ with error bars, and what the logs hardly tell."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from functools import partial

from nicegui import ui

from furuta_gym.plant import THETA_MEANING
from identification import Estimate, Gap, Log, excite, identify, validate
from identification.estimation.estimate import unit_of
from identification.estimation.identifiability import WEAK
from identification.validation.adequacy import Adequacy

from .. import commands
from ..frame import Frame, cells, command_line, heading, light, message, number_card
from ..work import Job, sentence
from ..written import write_plant


def show(frame: Frame) -> None:
    session = frame.session
    if not session.accepted:
        message("First say how the logs are read: view Log, button “Use these logs”.")
        return
    if session.estimate is None:
        message("Model (5) is fitted to all logs together. It takes about 10 s to a minute for 20 s of log.")
        ui.button("Identify", icon="functions", on_click=lambda: run(frame)).mark("run-identify").set_enabled(
            not frame.doing
        )
        command_line(commands.identify(session))
        return
    _adequate(frame, session.gap)
    _parameters(session.estimate)
    _weak(session.estimate)
    with ui.row().classes("wrap-row"):
        ui.button("What if …", icon="tune", on_click=lambda: frame.show("What if"))
        ui.button("Design the next experiment", on_click=lambda: _next(frame)).props("outline")
        ui.button("Save rig.json", on_click=lambda: _save(frame)).props("outline")
    if text := frame.of(_Next).text:
        message(text, "none")
    command_line(f"{commands.identify(session)} && {commands.validate(session)}")


class _Next:
    """The next experiment, in words, once it was asked for."""

    text = ""


_STATES = {
    Adequacy.ADEQUATE: "good",
    Adequacy.SMALL: "doubt",
    Adequacy.UNKNOWN: "doubt",
    Adequacy.INADEQUATE: "bad",
}


async def run(frame: Frame) -> None:
    """Fit the logs and show the result."""
    session, logs, job = frame.session, frame.session.logs, Job()
    found = await frame.run("Fitting model (5) to the logs", fit, logs, job, job=job)
    if found is None or frame.session is not session:
        return
    if session.logs is logs:
        session.estimate, session.gap, session.gap_remark = found
    else:
        frame.failure = "The logs changed while they were fitted. Identify again."
    frame.show()


def fit(logs: Sequence[Log], job: Job) -> tuple[Estimate, Gap | None, str]:
    """The estimate and its error on the logs, or why that could not be measured. Raises Cancelled."""
    estimate = identify(logs, pool=job.pool)
    job.check()
    try:
        return estimate, validate(estimate.plant, logs), ""
    except ValueError as error:
        return estimate, None, sentence(error)


def _adequate(frame: Frame, gap: Gap | None) -> None:
    heading("Is the model adequate?")
    if gap is None:
        message(f"The error could not be measured: {frame.session.gap_remark}", "doubt")
        return
    ratio, adequacy = gap.ratio_to_floor, gap.judgement.adequacy
    state = _STATES[adequacy]
    ahead = f"{gap.horizon:g} s ahead, on the fitted logs"
    with ui.element("div").classes("cards"):
        number_card(
            "Gap, times the noise floor",
            f"{ratio:.3g} ×",
            f"{ahead}; 1 is as good as noise allows",
            state,
            str(adequacy),
        )
        number_card("Fit of the arm", _signed(gap.fit_percent[0]), f"q1, {ahead}")
        number_card("Fit of the pendulum", _signed(gap.fit_percent[1]), f"q2, {ahead}")
    message(_here(gap.verdict) + ".", state)


def _parameters(estimate: Estimate) -> None:
    heading("Parameters")
    with ui.element("div").classes("scroll"), ui.element("table").classes("table params"):
        with ui.element("thead"), ui.element("tr"):
            cells(["", "meaning", "value ± standard deviation", "unit", "relative", ""], "th")
        with ui.element("tbody"):
            for name, value, std in zip(estimate.names, estimate.values, estimate.std, strict=True):
                with ui.element("tr"):
                    meaning = THETA_MEANING[name][0] if name in THETA_MEANING else "sharpness of the Coulomb friction"
                    lost = name in estimate.identifiability.unidentified
                    relative = _percent(std / abs(value)) if value and not lost else ""
                    cells([_greek(name), meaning, estimate.shown(name), unit_of(name, estimate.plant), relative])
                    with ui.element("td"):
                        _certainty(estimate, name)


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %" if share >= 0.1 else f"{100 * share:.2g} %"


def _certainty(estimate: Estimate, name: str) -> None:
    known = estimate.identifiability
    if name in estimate.at_bound:
        light("bad", "at its bound")
    elif name in known.unidentified:
        light("bad", "not identified")
    elif name in known.weak:
        light("doubt", "weak")
    elif name.startswith("r") and (known.relative_std or {}).get(name, 0.0) >= WEAK:
        light("none", "not judged")  # a detail of friction near rest, no reason for alarm
    elif name in estimate.uncertain:
        light("doubt", "uncertain")
    else:
        light("good", "identified")


def _weak(estimate: Estimate) -> None:
    heading("What the logs tell")
    message(_here(estimate.verdict) + ".", "good" if estimate.valid else "doubt")
    for text in (*estimate.identifiability.advice, *estimate.warnings):
        message(_here(text), "doubt")


def _here(text: str) -> str:
    """A sentence of the command line, as the page says it."""
    text = text.replace("run `furuta diagnose`", "see the view Diagnose").replace(
        "`furuta diagnose`", "the view Diagnose"
    )
    return text if text.startswith("θ") else f"{text[:1].upper()}{text[1:]}"


def _signed(percent: float) -> str:
    return f"{percent:.1f} %".replace("-", "−")


def _greek(name: str) -> str:
    return name.replace("theta", "θ")


async def _next(frame: Frame) -> None:
    estimate = frame.session.estimate
    assert estimate is not None
    job = Job()
    design = await frame.run(
        "Designing the next experiment", partial(excite, progress=job.tell), estimate.plant, job=job
    )
    if design is not None:
        frame.of(_Next).text = f"{design}\nThe command that writes it: {commands.excite()}"
        frame.show()


def _save(frame: Frame) -> None:
    estimate = frame.session.estimate
    assert estimate is not None
    try:
        path = frame.session.target("rig.json")
        frame.failure = write_plant(estimate.plant, path)
    except (ValueError, OSError) as error:
        frame.failure = sentence(error)
        frame.show()
        return
    frame.show()
    frame.note(f"Written: {shlex.quote(str(path))}")
