"""What a page holds, as values: a verdict, sections of blocks, and facts about both. `page.render` turns them to HTML.

Text is `Markup`: `Markup("<b>{}</b>").format(name)` escapes what it is given, and a plain string is escaped as a whole.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, ClassVar

if TYPE_CHECKING:  # libraries of the extra "report": the words of a refusal must do without them
    from markupsafe import Markup

    from .drawing import Drawing


@dataclass(frozen=True)
class Text:
    """A paragraph; style: "", "note" (set apart), "strong" or "quiet"."""

    kind: ClassVar[str] = "text"
    text: Markup | str
    style: str = ""


@dataclass(frozen=True)
class Heading:
    """A heading within a section."""

    kind: ClassVar[str] = "heading"
    text: str


@dataclass(frozen=True)
class Table:
    """Head and rows of text; the first column names the row."""

    kind: ClassVar[str] = "table"
    head: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]
    caption: str


@dataclass(frozen=True)
class Bar:
    """One bar: what it stands for in words, its identifier, its length as a share of the longest, and its text.

    role: "chosen", "equal" or "other"."""

    label: str
    identifier: str
    share: float
    text: str
    role: str = "other"


@dataclass(frozen=True)
class Bars:
    """Bars below one another, drawn without a script."""

    kind: ClassVar[str] = "bars"
    bars: tuple[Bar, ...]
    caption: str


@dataclass(frozen=True)
class Figure:
    """A figure of `drawing`."""

    kind: ClassVar[str] = "figure"
    drawing: Drawing


@dataclass(frozen=True)
class Grid:
    """Small figures side by side."""

    kind: ClassVar[str] = "grid"
    drawings: tuple[Drawing, ...]


@dataclass(frozen=True)
class Details:
    """Blocks that a click opens."""

    kind: ClassVar[str] = "details"
    summary: str
    blocks: tuple[Block, ...]
    opened: bool = False


Block = Text | Heading | Table | Bars | Figure | Grid | Details


@dataclass(frozen=True)
class Section:
    """A part of the page with a heading; `anchor` is its address within the page."""

    anchor: str
    title: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True)
class Fact:
    """A number of the first screen: what it is, its value with the unit, and what it means."""

    name: str
    value: str
    meaning: str


@dataclass(frozen=True)
class Verdict:
    """The first screen. headline: the answer in one or two sentences; badge: in a word or two, `good` for its colour.

    doubts: sentences that limit the answer. facts: its numbers. next: what to do. blocks: small print below."""

    badge: str
    good: bool
    headline: str
    doubts: tuple[str, ...]
    facts: tuple[Fact, ...]
    next: str
    blocks: tuple[Block, ...] = ()

    def with_blocks(self, blocks: tuple[Block, ...]) -> Verdict:
        """The same with small print below."""
        return replace(self, blocks=blocks)


@dataclass(frozen=True)
class Page:
    """A report. kicker: the command and its logs."""

    title: str
    kicker: str
    verdict: Verdict
    sections: tuple[Section, ...]
    footer: tuple[Block, ...] = field(default=())
