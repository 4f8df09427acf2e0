"""The frame of one tab: which view is shown, what is going on, and the pieces that every view is made of."""

from __future__ import annotations

import asyncio
import json
import re
import weakref
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from typing import TYPE_CHECKING, Any, TypeVar
from weakref import WeakSet

from nicegui import ui

from . import LARGEST_FILE
from .work import Cancelled, Job, off_loop, sentence

if TYPE_CHECKING:
    from .session import Session

T = TypeVar("T")
VIEWS = {
    "Log": "log",
    "Identify": "identify",
    "What if": "what_if",
    "Residuals": "residuals",
    "Diagnose": "diagnose",
    "Play": "play",
    "Export": "export",
}
"""Views in their order, and the modules of `views` that draw them, which are loaded when they are needed."""
LIGHTS = {
    "good": ("check_circle", "light-good"),
    "doubt": ("help", "light-doubt"),
    "bad": ("error", "light-bad"),
    "none": ("radio_button_unchecked", "light-none"),
}


@dataclass(eq=False)
class Frame:
    """One tab of the browser. state: what views keep while another one is shown. lock: held while logs change.

    job: of the computation that runs, or of the last one; stops: whether it asks that job whether to go on. noted:
    whether the footer says what `note` said last."""

    session: Session
    current: str = "Log"
    state: dict[type, Any] = field(default_factory=dict)
    body: ui.element | None = None
    tabs: ui.tabs | None = None
    footer: ui.label | None = None
    lock: asyncio.Lock = field(default_factory=asyncio.Lock)
    doing: str = ""
    failure: str = ""
    noted: bool = False
    stops: bool = False
    job: Job = field(default_factory=Job)
    _shown: str = ""
    _told: str = ""
    _saved: tuple[object, ...] = (None, None, None)

    def __post_init__(self) -> None:
        _frames.add(self)

    def of(self, kind: type[T]) -> T:
        """The state of a view, made when it is first asked for."""
        return self.state.setdefault(kind, kind())

    def reset(self) -> None:
        """Forget what views computed from logs that are read otherwise now."""
        self.state.clear()

    def show(self, name: str | None = None) -> None:
        """Draw a view, or the present one again."""
        if self.body is None or self.body.is_deleted:
            return
        self.current = name or self.current
        if self.tabs is not None and self.tabs.value != self.current:
            self.tabs.set_value(self.current)
        self.body.clear()
        self.body.props["data-view"] = self.current
        with self.body:
            if self.failure:
                message(self.failure, "bad")
            if self.doing:
                with ui.row().classes("doing").props("role=status"):
                    ui.spinner(size="1.4em")
                    ui.label(self.doing)
                    if self.stops and not (self.job.running or self.job.cancelled):  # a search has its own button
                        ui.button("Stop", icon="stop", on_click=self.stop).props("outline dense").mark("stop")
            view(self.current).show(self)
        self.tell_browser()

    def tell_browser(self) -> None:
        """Which view its history has, whether it asks before it leaves the page, and that a new failure is seen."""
        if self.body is None or self.body.is_deleted:
            return
        keeps = bool(self.doing) or not self.saved
        script = f"studio.at({json.dumps(self.current)}); studio.keeps = {json.dumps(keeps)};"
        if self.failure and self.failure != self._shown:  # whoever pressed a button further down would not see it
            script += " window.scrollTo(0, 0);"
        self._shown = self.failure
        if script != self._told:
            self._told = script
            self.body.client.run_javascript(script)

    @property
    def saved(self) -> bool:
        """Whether a saved session holds all that was computed."""
        return all(now is None or now is then for now, then in zip(self._computed, self._saved, strict=True))

    def mark_saved(self) -> None:
        """A file holds the session as it is."""
        self._saved = self._computed

    @property
    def _computed(self) -> tuple[object, ...]:
        return self.session.estimate, self.session.kept, self.session.found

    def close(self) -> None:
        """The tab is gone: end what it computes, and delete what was dropped."""
        self.job.cancel()
        self.session.close()

    async def run(self, doing: str, function: Callable[..., T], *arguments: Any, job: Job | None = None) -> T | None:
        """Compute off the event loop, showing what is done. None, and a sentence on the page, where it fails.

        job: what the computation asks whether it shall go on."""
        if self.doing:
            self.failure = f"Wait until this is done: {self.doing}"
            self.show()
            return None
        self.doing, self.failure, self.job, self.stops = doing, "", job or Job(), job is not None
        self.show()
        try:
            return await off_loop(function, *arguments)
        except Cancelled:
            return None
        except Exception as error:  # whatever it is, the page must live on
            self.failure = sentence(error)
            return None
        finally:
            self.doing, self.stops = "", False
            self.show()

    def stop(self) -> None:
        """End what is computed, as soon as it asks."""
        self.job.cancel()
        self.doing = "Stopping"
        self.show()

    def note(self, text: str) -> None:
        """Say something in the footer."""
        if self.footer is not None and not self.footer.is_deleted:
            self.footer.set_text(text)
            self.noted = True


_frames: WeakSet[Frame] = WeakSet()


def close_all() -> None:
    """End what every tab computes, and delete what was dropped there."""
    for frame in list(_frames):
        frame.close()


def put_texts(texts: Mapping[ui.label, str], moving: bool = False) -> None:
    """Change what labels say. moving: by a script alone, as the browser draws the whole page anew for an update; the
    texts must be put once more when the hand rests."""
    if not moving:
        for label, text in texts.items():
            label.set_text(text)
    said = json.dumps({label.id: text for label, text in texts.items()})
    client = next(iter(texts)).client
    client.run_javascript(f"studio.say({said})")  # after an update too: the page does not know what scripts said


def view(name: str) -> Any:
    """The module that draws a view."""
    return import_module(f".views.{VIEWS[name]}", __package__)


def drop_place(
    frame: Frame, label: str, dropped: Callable[[Frame, Any], Awaitable[None]], refused: str, most: int = 1
) -> ui.upload:
    """A place where files are dropped, at most so many. dropped: takes them. refused: said of those that are too large.

    FastAPI keeps the handlers of an upload for good, so that they must not hold the frame of a tab that is closed."""
    reference = weakref.ref(frame)

    async def take(event: Any) -> None:
        if (found := reference()) is not None:
            await dropped(found, event)

    def refuse() -> None:
        if (found := reference()) is not None:
            found.failure = refused
            found.show()

    handlers: dict[str, Any] = {"on_multi_upload": take, "max_files": most} if most > 1 else {"on_upload": take}
    upload = ui.upload(
        label=label,
        multiple=most > 1,
        auto_upload=True,
        max_file_size=LARGEST_FILE,
        on_rejected=refuse,
        **handlers,
    )
    return upload.classes("drop").props("flat bordered")


def light(state: str, word: str) -> None:
    """A light that says in a word, a shape and a colour how things are."""
    icon, style = LIGHTS[state]
    with ui.element("span").classes(f"light {style}"):
        ui.icon(icon).props("aria-hidden=true")
        ui.label(word)


def message(text: str, state: str = "none") -> None:
    """A sentence in a box; `bad` ones are read aloud. Commands, between backticks elsewhere, have quotation marks."""
    with ui.element("div").classes(f"message message-{state}").props("role=alert" if state == "bad" else "role=status"):
        ui.icon(LIGHTS[state][0]).props("aria-hidden=true")
        ui.label(re.sub(r"`([^`]+)`", r"“\1”", text))


def command_line(text: str) -> None:
    """The command line that does the same."""
    with ui.element("div").classes("command"):
        ui.label("The same on the command line").classes("command-title")
        with ui.element("div").classes("command-row"):
            ui.label(text).classes("command-text")
            ui.button(icon="content_copy", on_click=lambda: ui.clipboard.write(text)).props(
                'flat dense color=white aria-label="Copy the command line"'
            )


def number_card(title: str, value: str, meaning: str, state: str = "none", word: str = "") -> None:
    """One number that matters, with what it means."""
    with ui.element("div").classes("card"):
        ui.label(title).classes("card-title")
        ui.label(value).classes("card-value")
        ui.label(meaning).classes("card-meaning")
        if word:
            light(state, word)


def heading(text: str) -> None:
    with ui.element("h2"):
        ui.label(text)


def cells(row: list[str], kind: str = "td") -> None:
    """Plain text cells of a table's row."""
    for text in row:
        with ui.element(kind):
            ui.label(text)
