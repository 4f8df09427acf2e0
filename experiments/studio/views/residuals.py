"""Residuals: the torque that the model misses, over time and against any variable. No effect is named here."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from nicegui import ui
from numpy.typing import NDArray

from furuta_gym.plant import Plant
from identification import Log
from identification.diagnosis.locate.locate import locate
from identification.diagnosis.locate.location import Where
from identification.estimation.zeros import moved
from identification.kalman.coordinates import Zeros

from .. import charts, commands
from ..frame import Frame, command_line, heading, message

ROWS = ("arm", "pendulum")


@dataclass
class Missing:
    """What this view keeps: the torques, what is chosen, and the stretch of time."""

    where: Where | None = None
    row: str = "arm"
    against: str = "arm angle [rad]"
    which: int = 0
    span: tuple[float, float] | None = None


def show(frame: Frame) -> None:
    session = frame.session
    if session.estimate is None:
        message("First fit the model: view Identify.")
        return
    missing = frame.of(Missing)
    if missing.where is None:
        message("The torque that model (5) misses is estimated along the logs. It takes some seconds.")
        ui.button("Show what is missing", icon="insights", on_click=lambda: run(frame)).set_enabled(not frame.doing)
    else:
        _explore(frame, missing, missing.where)
    command_line(commands.residuals(session))


async def run(frame: Frame) -> None:
    """Follow the missing torque and show it."""
    estimate = frame.session.estimate
    assert estimate is not None
    missing = frame.of(Missing)
    found = await frame.run(
        "Following the torque that is missing", _locate, estimate.plant, frame.session.logs, estimate.zeros
    )
    if found is not None:
        missing.where = found
        frame.show()


def _locate(plant: Plant, logs: Sequence[Log], zeros: Zeros) -> Where:
    return locate(plant, moved(logs, zeros))


def variables(log: Log, t: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """What a missing torque may depend on, at times t [s]; the speeds are smoothed over 20 ms."""
    wide = max(3, round(0.02 / log.sample_time) | 1)
    kernel = np.ones(wide) / wide

    def speed(q: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.convolve(np.gradient(q, log.t), kernel, mode="same")

    columns = {
        "arm angle [rad]": log.q1,
        "arm speed [rad/s]": speed(log.q1),
        "pendulum angle [rad]": log.q2,
        "pendulum speed [rad/s]": speed(log.q2),
        f"command [{log.input_unit}]": log.u,
        "time [s]": log.t,
    }
    return {name: np.interp(t, log.t, values) for name, values in columns.items()}


def _explore(frame: Frame, missing: Missing, where: Where) -> None:
    torque = where.torques[missing.which]
    low, high = float(torque.t[0]), float(torque.t[-1])
    span = missing.span or (low, high)
    heading("Missing torque over time")
    with ui.row().classes("wrap-row"):
        ui.select(
            {i: t.source for i, t in enumerate(where.torques)},
            value=missing.which,
            label="Log",
            on_change=lambda e: _choose(frame, which=int(e.value), span=None),
        )
        ui.select(list(ROWS), value=missing.row, label="Row", on_change=lambda e: _choose(frame, row=e.value))
    series = []
    a = ROWS.index(missing.row)
    for sign in (-2.0, 2.0):
        band = torque.mean[:, a] + sign * torque.std[:, a]
        series.append(charts.line("± 2 std", charts.points(torque.t, band), "#6e7781", 0, "dotted", 1.0))
    series.append(charts.line("missing torque", charts.points(torque.t, torque.mean[:, a]), charts.SIMULATED))
    chart = ui.echart(charts.panes([f"{missing.row} [{where.unit}]"], series, zoom=False)).classes("chart")
    chart.props('role=img aria-label="Missing torque over time with its error"')
    heading("The same samples against a variable")
    with ui.row().classes("wrap-row"):
        names = list(variables(_log(frame, torque.source), torque.t))
        ui.select(names, value=missing.against, label="Against", on_change=lambda e: _choose(frame, against=e.value))
    ui.label(f"Stretch of time: {span[0]:.3g} to {span[1]:.3g} s").classes("card-meaning").mark("stretch")
    with ui.element("div").classes("inset"):
        ui.range(
            min=low,
            max=high,
            step=(high - low) / 200,
            value={"min": span[0], "max": span[1]},
            on_change=lambda e: _stretch(frame, e.value or {}),
        ).props('label debounce=400 aria-label="Stretch of time"').classes("wide")
    inside = (torque.t >= span[0]) & (torque.t <= span[1])
    x = variables(_log(frame, torque.source), torque.t)[missing.against]
    picture = charts.scatter(x[inside], torque.mean[inside, a], missing.against, f"{missing.row} [{where.unit}]")
    chart = ui.echart(picture).classes("chart").mark("against")
    chart.props(f'role=img aria-label="Missing torque against {missing.against}"')
    message("Guess first which effect it is. The view Diagnose looks for its name.")


def _log(frame: Frame, source: str) -> Log:
    logs = frame.session.logs
    return next((log for log in logs if log.source == source), logs[0])


def _stretch(frame: Frame, ends: dict[str, float]) -> None:
    if ends:
        _choose(frame, span=(float(ends["min"]), float(ends["max"])))


def _choose(frame: Frame, **chosen: Any) -> None:
    missing = frame.of(Missing)
    for name, value in chosen.items():
        setattr(missing, name, value)
    frame.show()
