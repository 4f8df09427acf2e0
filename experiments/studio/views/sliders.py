"""Sliders for a plant that is tried: one for each θ and each parameter of its effects, with a number beside it."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from nicegui import ui

from furuta_gym.plant import THETA_MEANING, Effect

from ..frame import heading
from ..what_if import NAMES, Choice, Range, addable, moved_by_hand

REST = 0.25  # s without a movement until the number beside a slider follows
OFTEN = 0.02  # s between two positions of a slider that moves


@dataclass(frozen=True)
class Sliders:
    """choice: what the sliders move. moved: called after each movement, with the time when the browser saw the hand
    move, by its own clock [ms], or None for what was typed. changed: called when an effect came or went."""

    choice: Choice
    moved: Callable[[float | None], Awaitable[None]]
    changed: Callable[[], Awaitable[None]]

    def effects(self) -> None:
        """Draw the effects: switched, removed and moved, and a list to add others from."""
        choice = self.choice
        heading("Effects")
        ui.select(
            addable(choice), label="Add an effect", with_input=True, on_change=lambda e: self._add(e.value)
        ).classes("wide").mark("add-effect")
        for name, values in choice.effects.items():
            kind = Effect(name).type
            with ui.element("div").classes("effect").mark(f"effect-{name}"):
                with ui.row().classes("effect-title"):
                    ui.switch(
                        kind.title,
                        value=name not in choice.off,
                        on_change=lambda e, n=name: self._switch(n, bool(e.value)),
                    )
                    ui.button(icon="close", on_click=lambda _, n=name: self._remove(n)).props(
                        f'flat dense aria-label="Remove {kind.title}"'
                    )
                ui.label(f"{name}: {kind.equation}").classes("card-meaning")
                for parameter in moved_by_hand(kind, values):
                    unit = parameter.unit.format(u=choice.base.unit)
                    put = partial(_set_effect, choice, name, parameter.name, parameter.integer)
                    slider = Slider(
                        f"{parameter.name} [{unit}]" if unit else parameter.name,
                        parameter.meaning,
                        choice.effect_range(name, parameter),
                        put,
                        self.moved,
                        f"{name}.{parameter.name}",
                    )
                    slider.draw(values[parameter.name])

    def theta(self) -> None:
        """Draw the parameters of model (5)."""
        choice = self.choice
        heading("Parameters of model (5)")
        for i, name in enumerate(NAMES):
            meaning, unit = THETA_MEANING[name]
            title = f"θ{i + 1} [{unit.format(u=choice.base.unit)}]"
            put = partial(_set_theta, choice, i)
            Slider(title, meaning, choice.theta_range(i), put, self.moved, name).draw(choice.theta[i])

    async def _add(self, name: str | None) -> None:
        if name is not None:
            self.choice.add(name)
            await self.changed()

    async def _remove(self, name: str) -> None:
        self.choice.remove(name)
        await self.changed()

    async def _switch(self, name: str, on: bool) -> None:
        (self.choice.off.discard if on else self.choice.off.add)(name)
        await self.moved(None)


class Slider:
    """A slider and a number for one value. put: takes the value; mark: names them for tests.

    The browser moves the slider by itself. It draws the whole page anew for each element that the server changes, so
    that number and slider are told the value when the hand rests, and not while it waits for a picture."""

    def __init__(
        self,
        title: str,
        meaning: str,
        span: Range,
        put: Callable[[float], None],
        moved: Callable[[float | None], Awaitable[None]],
        mark: str,
    ) -> None:
        self.title, self.meaning, self.span, self.put, self.moved, self.mark = title, meaning, span, put, moved, mark
        self._telling = False
        self._rest: asyncio.Task[None] | None = None

    def draw(self, value: float) -> None:
        """Draw both."""
        self.value = value
        with ui.element("div").classes("slider"):
            ui.label(self.title).classes("slider-title")
            ui.label(self.meaning).classes("card-meaning")
            with ui.row().classes("slider-row"):
                # ui.slider would report each movement twice
                self._slider = ui.element("q-slider").classes("slider-track").mark(f"slider-{self.mark}")
                self._slider.props(f'aria-label="{self.title}: {self.meaning}"')
                self._slider.props["min"] = min(self.span.low, value)
                self._slider.props["max"] = max(self.span.high, value)
                self._slider.props["step"] = self.span.step
                self._slider.props["model-value"] = value
                stamped = f"(value) => emit(value, studio.moved({self._slider.id}, value))"
                self._slider.on("update:model-value", self._grabbed, throttle=OFTEN, js_handler=stamped)
                self._box = (
                    ui.number(value=float(f"{value:.5g}"), on_change=self._typed, format="%.4g")
                    .props(f'dense outlined debounce=300 aria-label="{self.title}, as a number" step=any')
                    .classes("slider-number")
                    .mark(f"number-{self.mark}")
                    .on("blur", self._left)
                )

    async def _grabbed(self, event: Any) -> None:
        value, stamp = event.args
        if value is None or value == self.value:
            return
        self._rest = asyncio.create_task(self._tell_at_rest(float(value)))
        await self._take(float(value), float(stamp))

    async def _typed(self, event: Any) -> None:
        if event.value is None or self._telling or event.value == self.value:
            return
        self._slider.props["model-value"] = float(event.value)
        await self._take(float(event.value), None)

    def _left(self) -> None:
        if self._box.value is None:  # nothing was typed in the place of what was deleted
            self._tell(self.value)

    async def _take(self, value: float, stamp: float | None) -> None:
        self.value = value
        self.put(value)
        await self.moved(stamp)

    async def _tell_at_rest(self, value: float) -> None:
        await asyncio.sleep(REST)
        if self.value != value or self._box.is_deleted:
            return
        self._slider.props["model-value"] = value
        self._tell(value)

    def _tell(self, value: float) -> None:
        self._telling = True
        self._box.set_value(float(f"{value:.5g}"))
        self._telling = False


def _set_theta(choice: Choice, i: int, value: float) -> None:
    choice.theta[i] = value


def _set_effect(choice: Choice, name: str, parameter: str, whole: bool, value: float) -> None:
    choice.effects[name][parameter] = float(round(value)) if whole else value
