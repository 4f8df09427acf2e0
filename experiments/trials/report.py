"""What the trials say: tables, summary.json, summary.md, report.html and two pictures."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from .outcomes import outcomes_table
from .pictures import PICTURES, draw_pictures
from .power import PowerCurve
from .scoring import Outcome
from .summary import ALL, USUAL, confusion, power_curves, power_table, rate, summarize
from .trial import NOTHING

FILES = ("summary.json", "confusion.csv", "power.csv", "outcomes.csv", "summary.md", "report.html", *PICTURES)


def write_report(
    folder: Path, outcomes: Sequence[Outcome], about: Mapping[str, Any], for_power: Sequence[Outcome] = ()
) -> dict[str, Any]:
    """Write all files into `folder`; returns the summary.

    about: how the trials were run, goes into it as it is. for_power: trials of `--power`, which only the power curves
    count: they are of other sizes, and their rates would be other rates.
    """
    tried = [*outcomes, *for_power]
    table, curves = confusion(outcomes), power_curves(tried)
    summary = {"run": dict(about)} | summarize(outcomes)
    write = {
        "summary.json": json.dumps(summary, ensure_ascii=False, indent=2, allow_nan=False) + "\n",
        "confusion.csv": table.to_csv(),
        "power.csv": power_table(curves).to_csv(index=False),
        "outcomes.csv": outcomes_table(outcomes).to_csv(index=False),
        "summary.md": markdown(summary, curves),
        "report.html": _html(summary, table, curves, tried),
    }
    for name, text in write.items():
        (folder / name).write_text(text, encoding="utf-8")
    draw_pictures(table, curves, tried, folder)
    return summary


def percent(share: Mapping[str, Any] | None) -> str:
    """84 of 100 = 84 % (75 … 91 %)."""
    if share is None:
        return "–"
    interval = f"{100 * share['low']:.0f} … {100 * share['high']:.0f} %"
    return f"{share['count']} of {share['of']} = {100 * share['rate']:.0f} % ({interval})"


def headline(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    """(question, answer) of the main results; questions that no trial asked are left out."""
    library, strong, composite = summary["library"], summary["strong"], summary["composite"]
    forms, outside = summary["library_by_form"], summary["outside_answers"]

    def share(kinds: Sequence[str], *results: str) -> str:
        of = sum(summary["trials"][kind] for kind in kinds)
        count = sum(summary[kind][result]["count"] for kind in kinds for result in results if result in summary[kind])
        return percent(rate([True] * count + [False] * (of - count)))

    def shortcomings(some: Mapping[str, Any]) -> list[tuple[str, str]]:
        none = some["right_alone"] and rate([False] * some["right_alone"]["of"])
        return [(f"… {said}", percent(some["results"].get(key) or none)) for key, said in _SHORTCOMINGS.items()]

    rows = [
        (
            f"one effect, error-to-noise ratio {USUAL[0]:g} to {USUAL[1]:g}: named right, alone",
            percent(library["right_alone"]),
        ),
        ("… named right, alone or in a set of two equals", percent(library["right_within_two"])),
        ("… inside the stated sets", percent(library["inside_the_stated_sets"])),
        *((f"… alone, {said}", percent(forms[form]["right_alone"])) for form, said in _FORMS.items()),
        *shortcomings(library),
        (f"one effect, error-to-noise ratio above {USUAL[1]:g}: named right, alone", percent(strong["right_alone"])),
        ("… named right, alone or in a set of two equals", percent(strong["right_within_two"])),
        ("… inside the stated sets", percent(strong["inside_the_stated_sets"])),
        *shortcomings(strong),
        *(
            (f"one effect whose ratio {said}: named right, alone", percent(library[key]["right_alone"]))
            for key, said in (("below_visible", f"is below {USUAL[0]:g}"), ("not_measured", "was not measured"))
        ),
        ("nothing to name: false alarms", percent(summary["false_alarms"])),
        *((f"… of these: {said}", share([kind], "false_alarm")) for kind, said in _NOTHING.items()),
        ("nothing to name: called unknown", share(NOTHING, "unknown")),
        ("outside the library: something unknown is said to be there", share(["outside"], "right")),
        *((f"… of these: {said}", percent(share)) for said, share in outside.items()),
        ("two effects: both named right, alone or in sets of two", share(["two"], "right", "pair")),
        ("two effects: one of them", share(["two"], "half")),
        ("three to five effects: effects named, alone or in sets of two", percent(composite["effects_named"])),
        ("… rigs with a false name", percent(composite["rigs_with_a_false_name"])),
        (
            "… held-out error over the noise floor, median",
            _quantile(composite["after_over_floor"], "median"),
        ),
        ("hard friction alone: named friction_sharpness", share(["hard"], "right", "pair")),
        ("parameters: 95 % intervals that hold the truth", percent(summary["coverage_95"])),
        *(
            (f"… in answers that say {name}", percent(share))
            for name, share in summary["coverage_95_by_leftover"].items()
        ),
        ("closed share of right names on held-out data, median", _quantile(summary["closed_fraction"], "median")),
        (
            "held-out error after right names over the noise floor, median",
            _quantile(summary["after_over_floor"], "median"),
        ),
        ("time of one diagnosis [s]: median / 95 %", _times(summary["runtime_s"])),
        *((f"… {said}", _times(times)) for said, times in summary["runtime_s_by_answer"].items()),
    ]
    if len(summary["codes"]) > 1:
        told = ", ".join(f"{count} of {code}" for code, count in summary["codes"].items())
        rows.append(("answers come from different codes", told))
    return [row for row in rows if row[1] != "–"]


_INTERVALS = (
    "In brackets: exact 95 % intervals (Clopper–Pearson). Where a rig gives several answers, they are those of Korn "
    "and Graubard, which allow for these being alike."
)
_LIMITS_HEAD = (
    "effect",
    f"right within two, error-to-noise ratio {USUAL[0]:g} to {USUAL[1]:g}",
    "half are named at a ratio of",
    "95 % at",
)
_LIMITS_CAPTION = (
    "Error-to-noise ratios, medians and 95 % intervals of a logistic curve with lapses; 1 is invisible. "
    "Below, above: all or none of the trials were named right, and this is the end of the interval. Never: misses "
    "that size does not explain may be more than 5 %."
)
_SHORTCOMINGS = {
    "extra": "right, with a false one beside it",
    "wrong": "wrong name",
    "missed": "nothing named",
    "unknown": "called unknown",
    "insufficient": "called insufficient excitation",
    "error": "error",
}
_FORMS = {"table": "where the effect has the library's own equation", "bench": "where another law of the same cause"}
_NOTHING = {
    "none": "nothing hidden",
    "torque_noise": "random torque",
    "absorbed": "what θ takes in (back-EMF, gain)",
    "rounding": "rounding alone, in a second simulator",
}


def markdown(summary: Mapping[str, Any], curves: Mapping[str, PowerCurve]) -> str:
    """The main results and a line per effect as Markdown tables."""
    first = _markdown_table(("question", "answer (95 % interval)"), headline(summary))
    return first + "\n" + _markdown_table(_LIMITS_HEAD, limits_rows(summary, curves))


def _markdown_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def limits_rows(summary: Mapping[str, Any], curves: Mapping[str, PowerCurve]) -> Sequence[tuple[str, ...]]:
    """A row per curve: the effect, how many of the visible were right, and where half and 95 % are named."""
    rows = []
    for name, curve in curves.items():
        visible = summary["library"] if name == ALL else summary["library_by_effect"].get(name, {})
        rows.append((name, percent(visible.get("right_within_two")), *_limits(curve)))
    return rows


def _limits(curve: PowerCurve) -> tuple[str, str]:
    """The ratios at which half and 95 % are named; where the trials bound them on one side, only that side."""

    def said(share: float) -> str:
        low, median, high = (f"{r:.3f}" if r < 100.0 else "never" for r in curve.ratio_at(share))
        if curve.limit == "below":
            return f"below {high}" if high != "never" else f"{median}, or never"
        return f"above {low}" if curve.limit == "above" else f"{median} ({low} … {high})"

    return said(0.5), said(0.95)


def _quantile(quantiles: Mapping[str, float] | None, name: str) -> str:
    return "–" if quantiles is None else f"{quantiles[name]:.2f} (of {quantiles['of']:.0f})"


def _times(quantiles: Mapping[str, float] | None) -> str:
    return "–" if quantiles is None else f"{quantiles['median']:.0f} / {quantiles['q95']:.0f}"


def _html(
    summary: Mapping[str, Any], table: pd.DataFrame, curves: Mapping[str, PowerCurve], outcomes: Sequence[Outcome]
) -> str:
    from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
    from plotly.offline import get_plotlyjs

    from .figures import confusion_figure, power_figure

    loaders = [PackageLoader("experiments.trials", "."), PackageLoader("experiments.report")]
    pages = Environment(loader=ChoiceLoader(loaders), undefined=StrictUndefined, autoescape=True)
    return pages.get_template("page.html").render(
        plotly=get_plotlyjs(),
        run=summary["run"],
        headline={"head": ("question", "answer"), "rows": headline(summary), "caption": _INTERVALS},
        limits={"head": _LIMITS_HEAD, "rows": limits_rows(summary, curves), "caption": _LIMITS_CAPTION},
        confusion=confusion_figure(table),
        power=power_figure(curves, outcomes),
    )
