"""Rates with their intervals: from outcomes to the numbers of summary.json, confusion.csv and power.csv."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import beta, binomtest

from experiments.bench import SETS

from .power import PowerCurve, fit_power
from .scoring import RIGHT, Outcome
from .trial import KINDS, NOTHING

SCHEMA = "furuta-trials/1"
USUAL = (1.1, 10.0)
"""Measured gap ratios of effects of usual size; smaller ones are left to the power curves, larger ones are strong."""

ALL = "all effects"
"""The name of the power curve of all trials together."""

_NO_NAME = ("none", "unknown", "insufficient", "error")


def rate(of: Iterable[bool]) -> dict[str, Any] | None:
    """Share of the true ones with its exact (Clopper–Pearson) 95 % interval; None of nothing."""
    values = list(of)
    if not values:
        return None
    low, high = binomtest(sum(values), len(values)).proportion_ci(method="exact")
    share = sum(values) / len(values)
    return {"count": sum(values), "of": len(values), "rate": share, "low": float(low), "high": float(high)}


def rate_over_rigs(rigs: Iterable[Iterable[bool]]) -> dict[str, Any] | None:
    """Share of the true ones of all rigs, with an interval that allows for answers of one rig being alike.

    Korn and Graubard's interval (Survey Methodology 24, 1998): the exact one of as many independent answers as say as
    much. Their number follows from the variance between the rigs; where all answers are the same, it is the number of
    rigs. None of nothing.
    """
    answers = [list(rig) for rig in rigs]
    counts = np.array([(sum(rig), len(rig)) for rig in answers if rig], dtype=float).reshape(-1, 2)
    if not len(counts):
        return None
    m, count, of = len(counts), int(counts[:, 0].sum()), int(counts[:, 1].sum())
    share, worth = count / of, float(m)
    if 0.0 < share < 1.0 and m > 1:
        between = m / (m - 1) * np.sum((counts[:, 0] - share * counts[:, 1]) ** 2)
        worth = of / max(1.0, between / (of * share * (1.0 - share)))
    right, wrong = share * worth, (1.0 - share) * worth
    low = float(beta.ppf(0.025, right, wrong + 1.0)) if count else 0.0
    high = float(beta.ppf(0.975, right + 1.0, wrong)) if count < of else 1.0
    return {"count": count, "of": of, "rigs": m, "rate": share, "low": low, "high": high}


def summarize(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """All rates: {kind: {result: rate}}, and those of single effects by their measured size."""
    by_kind = {kind: [o for o in outcomes if o.kind == kind] for kind in KINDS}
    single = [*by_kind["library"], *by_kind["strong"]]
    sized = [(o, o.ratio) for o in single if o.ratio is not None]
    library = [o for o, ratio in sized if USUAL[0] <= ratio <= USUAL[1]]
    strong = [o for o, ratio in sized if ratio > USUAL[1]]
    nothing = [o for kind in NOTHING for o in by_kind[kind]]
    right = [o for o in outcomes if o.right and o.kind in ("library", "strong", "two")]
    return {
        "schema": SCHEMA,
        "trials": {kind: len(some) for kind, some in by_kind.items()},
        "codes": dict(Counter(o.code or "not kept" for o in outcomes)),
        "library": _library(library)
        | {
            "below_visible": _library([o for o, ratio in sized if ratio < USUAL[0]]),
            "not_measured": _library([o for o in single if o.ratio is None]),
        },
        "library_by_rig": {rig: _library([o for o in library if o.rig == rig]) for rig in SETS},
        "library_by_form": {form: _library([o for o in library if o.form == form]) for form in ("table", "bench")},
        "library_by_effect": {s: _library([o for o in library if o.subject == s]) for s in _subjects(library)},
        "strong": _library(strong),
        "composite": _composite(by_kind["composite"]),
        "false_alarms": rate(o.result == "false_alarm" for o in nothing),
        "absorbed_reported": rate(o.reported_absorbed for o in by_kind["absorbed"]),
        **{kind: _results(by_kind[kind]) for kind in KINDS if kind not in ("library", "strong", "composite")},
        "outside_answers": {
            "no name": rate(o.right and not o.named for o in by_kind["outside"]),
            "a name for a part, and something left": rate(o.right and bool(o.named) for o in by_kind["outside"]),
            "a name, and nothing left": rate(o.result == "wrong" for o in by_kind["outside"]),
        },
        "coverage_95": rate_over_rigs(o.covered.values() for o in outcomes),
        "coverage_95_by_leftover": {
            name: rate_over_rigs(o.covered.values() for o in outcomes if o.leftover == left)
            for name, left in (("nothing left", False), ("something left", True))
        },
        "coverage_95_by_parameter": _coverage(outcomes),
        "closed_fraction": _quantiles(o.closed_fraction for o in right),
        "after_over_floor": _quantiles(o.after_over_floor for o in right),
        "runtime_s": _quantiles(o.runtime_s for o in outcomes),
        "runtime_s_by_answer": {
            "at most one name, nothing left": _quantiles(o.runtime_s for o in outcomes if _simple(o)),
            "several names or something left": _quantiles(o.runtime_s for o in outcomes if not _simple(o)),
        },
    }


def confusion(outcomes: Iterable[Outcome]) -> pd.DataFrame:
    """Trials counted by what was hidden (rows) and what was named first (columns); rigs with several effects are left
    out.

    Library effects first, then what is outside it, then the trials with nothing to name."""
    shown = [o for o in outcomes if o.kind not in ("two", "composite")]
    outside = {o.subject for o in shown if o.kind == "outside"}
    table = pd.crosstab(
        pd.Series([_row(o) for o in shown], name="hidden", dtype=object),
        pd.Series([_answered(o) for o in shown], name="named", dtype=object),
    )
    rows = sorted(table.index, key=lambda name: (name.startswith("("), name in outside, name))
    names = [name for name in rows if name in table.columns]
    names += [c for c in table.columns if c not in names and c not in _NO_NAME]
    return table.reindex(index=rows, columns=[*names, *_NO_NAME], fill_value=0)


def power_curves(outcomes: Iterable[Outcome]) -> dict[str, PowerCurve]:
    """Effect → curve over its library trials; ALL → the curve of all together."""
    tried = [o for o in outcomes if o.kind == "library" and o.ratio is not None]
    groups = {ALL: tried} | {s: [o for o in tried if o.subject == s] for s in _subjects(tried)}
    curves = {name: fit_power([o.ratio or 1.0 for o in some], [o.right for o in some]) for name, some in groups.items()}
    return {name: curve for name, curve in curves.items() if curve is not None}


def power_table(curves: dict[str, PowerCurve]) -> pd.DataFrame:
    """One row per effect, as power.csv has it."""
    rows = [
        {
            "effect": name,
            "trials": curve.trials,
            "named_right": curve.right,
            **{
                f"ratio{share}{end}": ratio
                for share in (50, 95)
                for end, ratio in zip(("_low", "", "_high"), curve.ratio_at(share / 100), strict=True)
            },
            "limit": curve.limit,
            "smallest_tried": curve.tried[0],
            "largest_tried": curve.tried[1],
        }
        for name, curve in curves.items()
    ]
    return pd.DataFrame(rows, columns=None if rows else ["effect", "trials", "named_right"])


def _library(some: Sequence[Outcome]) -> dict[str, Any]:
    return {
        "right_alone": rate(o.result == "right" for o in some),
        "right_within_two": rate(o.result in RIGHT for o in some),
        "inside_the_stated_sets": rate(o.inside for o in some),
        "results": _results(some),
    }


def _composite(some: Sequence[Outcome]) -> dict[str, Any]:
    """Of rigs with several effects: effects named (in sets of at most two), rigs with a false name, what is left."""
    named = [[i < o.found for i in range(len(o.subject.split("+")))] for o in some]
    return {
        "effects_named": rate_over_rigs(named),
        "rigs_with_a_false_name": rate(o.false > 0 for o in some),
        "after_over_floor": _quantiles(o.after_over_floor for o in some),
        "results": _results(some),
    }


def _results(some: Sequence[Outcome]) -> dict[str, Any]:
    return {result: rate(o.result == result for o in some) for result in sorted({o.result for o in some})}


def _subjects(some: Iterable[Outcome]) -> list[str]:
    return sorted({o.subject for o in some})


def _simple(outcome: Outcome) -> bool:
    return len(outcome.named) <= 1 and not outcome.leftover


def _row(outcome: Outcome) -> str:
    return (
        outcome.subject if outcome.kind in ("library", "strong", "outside") else f"({outcome.kind.replace('_', ' ')})"
    )


def _answered(outcome: Outcome) -> str:
    if outcome.named:
        return outcome.named[0]
    if outcome.result in ("unknown", "insufficient", "error"):
        return outcome.result
    return "unknown" if outcome.kind == "outside" and outcome.result == "right" else "none"


def _coverage(outcomes: Iterable[Outcome]) -> dict[str, Any]:
    found: dict[str, list[bool]] = {}
    for outcome in outcomes:
        for parameter, covered in outcome.covered.items():
            found.setdefault(parameter, []).append(covered)
    return {parameter: rate(values) for parameter, values in sorted(found.items())}


def _quantiles(values: Iterable[float | None]) -> dict[str, float] | None:
    known = [v for v in values if v is not None]
    if not known:
        return None
    marks = {"q05": 0.05, "q25": 0.25, "median": 0.5, "q75": 0.75, "q95": 0.95, "max": 1.0}
    return {"of": len(known)} | {name: float(np.quantile(known, q)) for name, q in marks.items()}
