"""The page itself: figures, tables and sentences into one HTML file that needs no network."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.metadata import version
from importlib.util import find_spec
from typing import Any

from furuta_gym.plant import EFFECTS

from . import tables
from .examination import Examination
from .words import LABEL, MEANING

_SMALL = 0.01  # of the command's rms: torques below it are not blown up to fill a figure


@dataclass(frozen=True)
class Found:
    """One effect that was added, in words."""

    name: str
    equation: str
    symptom: str
    values: tuple[str, ...]
    gain: str
    confused_with: tuple[str, ...]


def require_extra() -> None:
    """Raises ValueError without the libraries that the page is made with, to be called before long work."""
    if lacking := [name for name in ("jinja2", "plotly") if find_spec(name) is None]:
        raise ValueError(f"report.html needs {' and '.join(lacking)}: pip install 'furuta-gym[report]'")


def build(examination: Examination) -> str:
    """The report as HTML. Everything is inside it, plotly.js too (4.8 MB; the package has no smaller build).

    Needs the extra "report" (see `require_extra`).
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape
    from plotly.offline import get_plotlyjs

    pages = Environment(
        loader=PackageLoader("experiments.report"),
        autoescape=select_autoescape(default=True),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return pages.get_template("report.html").render(_contents(examination), plotly=get_plotlyjs())


def _contents(x: Examination) -> dict[str, Any]:
    from . import prediction_figures, search_figures, where_figures

    d = x.diagnosis
    data = x.to_dict()
    changed = d.added
    return {
        "verdict": d.verdict,
        "label": LABEL[d.verdict],
        "summary": d.summary[:1].upper() + d.summary[1:],
        "meaning": MEANING[d.verdict],
        "effects": [_found(effect) for effect in data["effects"]],
        "not_visible": data.get("not_visible", []),
        "absorbed": data["absorbed"],
        "changed": changed,
        "gap": x.gap,
        "where": x.where,
        "where_after": x.where_after,
        "remarks": x.remarks,
        "predictions": prediction_figures.predictions(x.gap) if x.gap else None,
        "closed_loop": prediction_figures.closed_loop(x.closed_loop, x.shown) if x.closed_loop else None,
        "torques": where_figures.torques(x.where, x.where_after, _SMALL * d.command_rms) if x.where else [],
        "maps": where_figures.maps(x.where, x.where_after) if x.where else [],
        "suspicions": tables.suspicions(x.where) if x.where and x.where.found else None,
        "rankings": search_figures.rankings(d.naming) if d.naming else [],
        "parameters": tables.parameters(d.before, d.after if changed else d.before, d.leftover)
        if d.before and d.after
        else None,
        "parameter_figure": search_figures.parameters(d.before, d.after) if d.before and d.after and changed else None,
        "gaps": tables.gaps(x.gap) if x.gap else None,
        "own_gaps": tables.gaps(x.gap.own_tail) if x.gap and x.gap.own_tail else None,
        "horizons": prediction_figures.horizons(x.gap) if x.gap else None,
        "leftovers": tables.leftovers(x.where, x.where_after, d.policy.left) if x.where else None,
        "next_experiment": x.next_experiment,
        "logs": tables.logs(x.logs, x.held_out),
        "runtime": data["runtime_s"],
        "package": version("furuta-gym"),
    }


def _found(effect: dict[str, Any]) -> Found:
    values = tuple(
        f"{name} = {_number(p['value'])}" + (f" ± {p['std']:.2g}" if p.get("std") else "") + _unit(p["unit"])
        for name, p in effect["parameters"].items()
    )
    return Found(
        effect["name"],
        effect["equation"],
        EFFECTS[effect["name"]].symptom,
        values,
        f"{effect['log_likelihood_gain']:.0f}",
        tuple(effect["confused_with"]),
    )


def _unit(unit: str) -> str:
    return "" if unit in ("", "1") else f" {unit}"


def _number(value: float | None) -> str:
    return "none" if value is None else f"{value:.4g}"
