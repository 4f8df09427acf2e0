"""The closed loop of the view Play: a controller on the plant of this session, pushed by hand."""

from __future__ import annotations

import json
import time
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from nicegui import events, ui

from controllers import CONTROLLERS, Controller, make_controller
from furuta_gym import EFFECTS, Effect, Plant, Sensors

from .. import LARGEST_FILE, charts, commands
from ..frame import Frame, command_line, drop_place, heading, message
from ..loop import Conditions, Loop, traces
from ..what_if import Choice, moved_by_hand
from ..work import off_loop, sentence
from .export import best, plant_file
from .rig import rig, turn

FRAME, REDRAWN = 0.05, 0.25  # s
LATEST, NOISIEST = 0.1, 0.02  # s and rad, where the sliders end


class Playing:
    """What this view keeps: the controller's name, the conditions as the sliders stand, and the loop."""

    def __init__(self) -> None:
        self.name = "lqr"
        self.delay, self.noise, self.row = 0.0, 0.0, 0
        self.choice: Choice | None = None
        self.loop: Loop | None = None

    def conditions(self) -> Conditions:
        effects = tuple(self.choice.acting()) if self.choice is not None else ()
        return Conditions(self.delay, self.noise, effects)


def show(frame: Frame) -> None:
    session = frame.session
    plant = best(session)
    if plant is None:
        message("First fit the model: view Identify.")
        return
    playing = frame.of(Playing)
    if playing.choice is None:
        playing.choice = Choice(plant)
        playing.choice.effects = {}  # those of the plant act anyway
    _controllers(frame, playing, plant)
    if playing.loop is not None:
        with ui.element("div").classes("split"):
            with ui.element("div").classes("split-main"):
                _moving(frame, playing, playing.loop)
            with ui.element("div").classes("split-side"):
                _sliders(frame, playing)
    conditions = playing.conditions()
    command_line(
        commands.closed_loop(plant_file(session), plant, _typed(frame, playing.name), conditions, session.trusted)
    )


def _controllers(frame: Frame, playing: Playing, plant: Plant) -> None:
    with ui.row().classes("wrap-row"):
        ui.select(_offered(frame), value=playing.name, label="Controller", on_change=lambda e: _name(frame, e.value))
        text = "Play" if playing.loop is None else "Start again"
        ui.button(text, icon="play_arrow", on_click=lambda: begin(frame, plant)).mark("play").set_enabled(
            not frame.doing
        )
        refused = f"The file was refused: expected at most {LARGEST_FILE} bytes."
        drop_place(frame, "Drop a policy here (.zip)", _dropped, refused).props("accept=.zip").style("max-width: 320px")
    policy = frame.session.policy
    if policy is not None and playing.name == str(policy) and _foreign(policy) and not frame.session.trusted:
        message(
            f"{policy.name} was saved by stable-baselines3, and reading such a file runs any code that is in it. "
            "Read it only if you trust who made it.",
            "bad",
        )
        ui.button("I trust who made it: read it", on_click=lambda: _trust(frame, plant)).props("outline").mark("trust")


def _foreign(path: Path) -> bool:
    from controllers.learned.policy_file import from_stable_baselines3

    return from_stable_baselines3(path)


def _offered(frame: Frame) -> dict[str, str]:
    """Controllers and policies by what `make_controller` takes."""
    found = {name: f"{name}: {design.summary.replace('`', '')}" for name, design in CONTROLLERS.items()}
    folder = Path(str(files("controllers") / "policies"))
    found |= {str(path): f"policy {path.stem}" for path in sorted(folder.glob("*.zip"))}
    if (dropped := frame.session.policy) is not None:
        found[str(dropped)] = f"policy {dropped.stem}, dropped"
    return found


def _typed(frame: Frame, name: str) -> str:
    """A controller as it is typed; a dropped policy by its name."""
    return Path(name).name if frame.session.policy is not None and name == str(frame.session.policy) else name


async def begin(frame: Frame, plant: Plant) -> None:
    """Design the controller and let the loop go."""
    playing, session = frame.of(Playing), frame.session
    playing.loop = None
    made = await frame.run("Designing the controller", _made, playing.name, plant, session.trusted)
    if made is not None:
        playing.loop = Loop(plant, made, playing.conditions(), Sensors.of_file(plant.sensors))
        frame.show()


def _made(name: str, plant: Plant, trusted: bool) -> Controller:
    return make_controller(name, plant, trust=trusted)


def _moving(frame: Frame, playing: Playing, loop: Loop) -> None:
    with ui.scene(width=700, height=340, grid=False, background_color="#ffffff").classes("scene") as scene:
        shown = rig(scene, 0.0, charts.SIMULATED)
        scene.move_camera(2.2, -3.4, 2.2, 0.0, 0.0, 1.1)
    state = ui.label("").classes("card-meaning").mark("loop-state").props("role=status aria-live=off")
    _pushes(playing, loop)
    chart = ui.echart(_chart(loop)).classes("chart")
    chart.props('role=img aria-label="The last 5 s: arm, pendulum and command"')
    clock = {"last": time.monotonic(), "drawn": 0.0}

    async def step() -> None:
        now = time.monotonic()
        passed, clock["last"] = now - clock["last"], now
        try:
            await off_loop(loop.run, passed)
        except Exception as error:
            playing.loop = None
            _failed(frame, sentence(error))
            return
        if chart.is_deleted:
            return
        q1, q2 = loop.live.state[:2]
        turn(shown, float(q1), float(q2))
        word = "" if loop.fell is None else f" It fell after {loop.fell:.1f} s, and nothing is commanded since."
        degrees = np.degrees(np.remainder(q2 + np.pi, 2 * np.pi) - np.pi)
        state.set_text(
            f"{loop.live.t:.1f} s; pendulum {degrees:+.1f}° from upright; "
            f"command {100 * loop.live.command / loop.base.u_max:+.0f} % of u_max.{word}"
        )
        if now - clock["drawn"] > REDRAWN:
            clock["drawn"] = now
            change = json.dumps({"series": _series(loop)}, separators=(",", ":"))
            chart.client.run_javascript(f"studio.draw({chart.id}, {change}, null, {{}})")

    ui.timer(FRAME, step)


def _pushes(playing: Playing, loop: Loop) -> None:
    heading("Push")
    with ui.row().classes("wrap-row"):
        ui.select({0: "on the arm", 1: "on the pendulum"}, value=playing.row, label="Where").on_value_change(
            lambda e: setattr(playing, "row", int(e.value))
        )
        for text, icon, share in (("Push left", "west", -0.5), ("Push right", "east", 0.5)):
            ui.button(text, icon=icon, on_click=lambda _, s=share: loop.push(s, playing.row)).props("outline")
    with ui.element("div").classes("inset"):
        hand = (
            ui.slider(min=-1.0, max=1.0, step=0.05, value=0.0)
            .props('aria-label="Push: hold and drag; it springs back" label-always label-value="hold and drag"')
            .mark("hand")
        )
        hand.on("update:model-value", lambda e: loop.hold(float(e.args), playing.row), throttle=0.03)
        late = "() => setTimeout(() => emit(), 120)"  # after the last movement, which is told late itself
        hand.on("change", lambda: _released(hand, loop, playing), js_handler=late)


def _released(hand: Any, loop: Loop, playing: Playing) -> None:
    loop.hold(0.0, playing.row)
    hand.set_value(0.0)


def _sliders(frame: Frame, playing: Playing) -> None:
    heading("What the rig has beside its plant, and the controller does not know")
    _slider(frame, "Delay of the command [ms]", 1e3 * LATEST, 0.5, 1e3 * playing.delay, partial(_delay, playing))
    _slider(frame, "Noise of the readings [mrad]", 1e3 * NOISIEST, 0.1, 1e3 * playing.noise, partial(_noise, playing))
    choice = playing.choice
    assert choice is not None
    carried = {effect.name for effect in choice.base.effects}
    free = {name: f"{kind.title} ({name})" for name, kind in EFFECTS.items() if name not in {*choice.effects, *carried}}
    free.pop("input_delay", None)
    ui.select(free, label="Add an effect", with_input=True, on_change=lambda e: _add(frame, e.value)).classes("wide")
    for name, values in choice.effects.items():
        with ui.element("div").classes("effect"):
            with ui.row().classes("effect-title"):
                kind = Effect(name).type
                ui.label(kind.title).classes("slider-title")
                ui.button(icon="close", on_click=lambda _, n=name: _remove(frame, n)).props(
                    f'flat dense aria-label="Remove {kind.title}"'
                )
            for parameter in moved_by_hand(kind, values):
                span = choice.effect_range(name, parameter)
                unit = parameter.unit.format(u=choice.base.unit)
                title = f"{parameter.name} [{unit}]" if unit else parameter.name
                put = partial(_effect, choice, name, parameter.name, parameter.integer)
                _slider(frame, title, span.high, span.step, values[parameter.name], put, span.low)


def _slider(frame: Frame, title: str, high: float, step: float, value: float, put: Any, low: float = 0.0) -> None:
    def change(event: Any) -> None:
        put(float(event.value))
        shown.set_text(f"{float(event.value):.4g}")
        _changed(frame)

    with ui.element("div").classes("slider"):
        ui.label(title).classes("slider-title")
        with ui.row().classes("slider-row"):
            slider = ui.slider(min=min(low, value), max=max(high, value), step=step, value=value, on_change=change)
            slider.props(f'aria-label="{title}"').classes("slider-track").mark(f"loop-{title.split(' ')[0]}")
            shown = ui.label(f"{value:.4g}").classes("slider-number")


def _delay(playing: Playing, milliseconds: float) -> None:
    playing.delay = 1e-3 * milliseconds


def _noise(playing: Playing, milliradians: float) -> None:
    playing.noise = 1e-3 * milliradians


def _effect(choice: Choice, name: str, parameter: str, whole: bool, value: float) -> None:
    choice.effects[name][parameter] = float(round(value)) if whole else value


def _changed(frame: Frame) -> None:
    """The loop goes on under the conditions as the sliders stand."""
    playing = frame.of(Playing)
    if playing.loop is None:
        return
    try:
        playing.loop.change(playing.conditions())
    except ValueError as error:
        _failed(frame, sentence(error))


def _add(frame: Frame, name: str | None) -> None:
    playing = frame.of(Playing)
    if name is not None and playing.choice is not None:
        playing.choice.add(name)
        _changed(frame)
        frame.show()


def _remove(frame: Frame, name: str) -> None:
    playing = frame.of(Playing)
    assert playing.choice is not None
    playing.choice.remove(name)
    _changed(frame)
    frame.show()


def _name(frame: Frame, name: str) -> None:
    playing = frame.of(Playing)
    playing.name, playing.loop, frame.failure = name, None, ""
    frame.show()


async def _dropped(frame: Frame, event: events.UploadEventArguments) -> None:
    if event.file.size() > LARGEST_FILE:  # before it is taken into memory
        _failed(frame, f"{event.file.name}: {event.file.size()} bytes. Expected at most {LARGEST_FILE}.")
        return
    try:
        frame.session.take_policy(event.file.name, await event.file.read())
    except ValueError as error:
        _failed(frame, sentence(error))
        return
    _name(frame, str(frame.session.policy))


async def _trust(frame: Frame, plant: Plant) -> None:
    frame.session.trusted = True
    await begin(frame, plant)


def _failed(frame: Frame, text: str) -> None:
    frame.failure = text
    frame.show()


def _series(loop: Loop) -> list[dict[str, Any]]:
    past = traces(loop.past)
    kinds = (
        ("arm", charts.SIMULATED, "solid"),
        ("pendulum", charts.SECOND, "dashed"),
        ("command", charts.MEASURED, ""),
    )
    return [
        charts.line(name, charts.points(past[:, 0], past[:, i + 1]), colour, min(i // 2, 1), dash or "solid")
        for i, (name, colour, dash) in enumerate(kinds)
    ]


def _chart(loop: Loop) -> dict[str, Any]:
    return charts.panes(["angle [rad]", f"u [{loop.base.unit}]"], _series(loop), zoom=False)
