"""The frame of every report: a `Page` into one HTML file that needs no network and no other file."""

from __future__ import annotations

import re
from functools import cache
from importlib.resources import files
from importlib.util import find_spec
from typing import TYPE_CHECKING

from furuta_gym.extras import install

from .contents import Block, Details, Figure, Grid, Page

if TYPE_CHECKING:
    from markupsafe import Markup


def extra_lacking(page: str = "report.html") -> str:
    """What to install before a page can be made, in a sentence; empty where nothing is lacking."""
    lacking = [name for name in ("jinja2", "plotly") if find_spec(name) is None]
    return f"{page} needs {' and '.join(lacking)}: {install('report')}" if lacking else ""


def require_extra(page: str = "report.html") -> None:
    """Raises ValueError without the libraries that a page is made with, to be called before long work."""
    if lacking := extra_lacking(page):
        raise ValueError(lacking)


@cache
def plotly_js() -> str:
    """Plotly's basic bundle, which is kept beside this package (1.2 MB; the Python package holds only the full 4.8)."""
    return (files("experiments.report") / "vendor" / "plotly-basic.min.js").read_text(encoding="utf-8")


def render(page: Page) -> str:
    """The page as HTML. Needs the extra "report" (see `require_extra`)."""
    from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape

    pages = Environment(
        loader=PackageLoader("experiments.report"),
        autoescape=select_autoescape(default=True),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    pages.filters["inline"] = inline
    drawn = any(_has_figure(block) for section in page.sections for block in section.blocks)
    return pages.get_template("page.html").render(page=page, plotly=plotly_js() if drawn else "")


def inline(text: str) -> Markup:
    """Text, escaped unless it is `Markup`, with what stands between backticks as code."""
    from markupsafe import Markup, escape

    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(text))))


def _has_figure(block: Block) -> bool:
    if isinstance(block, Details):
        return any(map(_has_figure, block.blocks))
    return isinstance(block, Figure | Grid)
