"""What the report's tests ask of a page, and how they make one."""

from __future__ import annotations

import base64
import json
import re
from dataclasses import replace
from html import unescape
from html.parser import HTMLParser

import numpy as np
import pytest

pytest.importorskip("plotly", reason="the report needs the extra 'report'")
pytest.importorskip("jinja2", reason="the report needs the extra 'report'")

from experiments.report import Examination, render
from experiments.report.diagnosis_page import diagnosis_page
from identification.diagnosis.gap_change import GapChange
from identification.diagnosis.held_out import HeldOut
from identification.diagnosis.policy import DecisionPolicy
from identification.logs.log import Log


def build(examined: Examination) -> str:
    return render(diagnosis_page(examined))


def held(log: Log, *held_out: Log) -> HeldOut:
    """What judges a search in a log: others, or its own last part."""
    return HeldOut((log,), held_out, DecisionPolicy())


def with_gap(examined: Examination, gap: GapChange | None) -> Examination:
    return replace(examined, diagnosis=replace(examined.diagnosis, gap=gap))


class Page(HTMLParser):
    """What a test asks of a page: ids, figures' JSON, labels, addresses, text."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.ids: list[str] = []
        self.figures: dict[str, dict] = {}
        self.unlabelled: list[str] = []
        self.addresses: list[str] = []
        self.tags: list[str] = []
        self.headings: list[str] = []
        self.inside = ""
        self.heading = False
        self.feed(html)

    def handle_starttag(self, tag, attrs):
        found = dict(attrs)
        self.tags.append(tag)
        self.ids += [found["id"] or ""] if "id" in found else []
        self.addresses += [v or "" for k, v in attrs if k in ("src", "href", "srcset", "action")]
        if found.get("class") == "plot" and not (found.get("role") == "img" and found.get("aria-label")):
            self.unlabelled.append(str(found))
        self.headings += [""] if tag == "h2" else []
        self.inside = found.get("data-for", "") if tag == "script" else ""
        self.heading = tag == "h2"

    def handle_endtag(self, tag):
        self.heading = self.heading and tag != "h2"

    def handle_data(self, data):
        if self.inside:
            self.figures[self.inside] = json.loads(data)
            self.inside = ""
        if self.heading:
            self.headings[-1] += data


def text_of(html: str) -> str:
    """What a reader sees of a piece of a page."""
    inside = re.sub(r"<(script|style).*?</\1>", "", html, flags=re.S)
    return " ".join(unescape(re.sub(r"<[^>]+>", "", inside)).split())


def numbers_of(data) -> list[float]:
    """The entries of one of a trace's arrays of single precision, as Plotly writes them."""
    return np.frombuffer(base64.b64decode(data["bdata"]), dtype=data["dtype"]).tolist()


def size_of(data) -> int:
    """Number of entries of one of a trace's arrays, as Plotly writes them."""
    if isinstance(data, dict) and "bdata" in data:
        width = {"f4": 4, "f8": 8}.get(data["dtype"], 1)
        return len(data["bdata"]) * 3 // 4 // width
    return len(data) if isinstance(data, list) else 0
