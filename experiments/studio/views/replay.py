"""The replay of the view Play: the log and the what-if plant moving side by side."""

from __future__ import annotations

import math
import time

from nicegui import ui

from .. import commands
from ..frame import Frame, command_line, message
from ..work import sentence
from .live import Live
from .rig import rig, turn

FRAME = 0.05  # s


def show(frame: Frame) -> None:
    live = frame.of(Live)
    if live.window is None or live.last is None or live.choice is None:
        message("First start the view What if: what it shows is played here.")
        return
    log, angles = live.window.log, live.last.angles
    message("Left: measured. Right: simulated, from the same states every 0.3 s. Drag to turn, scroll to come nearer.")
    with ui.scene(width=900, height=420, grid=False, background_color="#ffffff").classes("scene") as scene:
        rigs = [rig(scene, -1.4, "#30363d"), rig(scene, 1.4, "#0b5cad")]
        scene.move_camera(0.0, -3.9, 2.0, 0.0, 0.0, 1.1)
    clock = {"at": 0.0, "last": time.monotonic(), "speed": 0.5}
    with ui.row().classes("wrap-row"):
        running = ui.switch("Running", value=True)
        ui.select(
            {0.1: "1/10", 0.25: "1/4", 0.5: "1/2", 1.0: "1"},
            value=0.5,
            label="Speed",
            on_change=lambda e: clock.update(speed=float(e.value)),
        )
        at = ui.label("").mark("clock")

    def step() -> None:
        now = time.monotonic()
        passed, clock["last"] = now - clock["last"], now
        if not running.value:
            return
        clock["at"] = (clock["at"] + clock["speed"] * passed) % log.duration
        k = min(int(clock["at"] / log.sample_time), len(log) - 1)
        turn(rigs[0], float(log.q1[k]), float(log.q2[k]))
        seen = angles[k] if math.isfinite(angles[k, 0]) else log.angles[k]
        turn(rigs[1], float(seen[0]), float(seen[1]))
        at.set_text(f"{log.t[k]:.2f} s")

    step()
    ui.timer(FRAME, step)
    try:
        if text := commands.what_if(frame.session, live.choice.plant()):
            command_line(text)
    except ValueError as error:  # the sliders stand where no plant is; what is played is the last that was one
        message(sentence(error), "bad")
