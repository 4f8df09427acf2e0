"""The page of `furuta validate`: does the plant predict these logs as well as the noise allows?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version

import numpy as np

from furuta_gym.plant import Plant
from furuta_gym.plant.effects.words import number
from identification.estimation.identifiability import spoken
from identification.logs.log import Log
from identification.validation.adequacy import SMALL_BELOW, Adequacy
from identification.validation.gap import Gap

from . import prediction_figures, tables
from .by_part import Parts
from .contents import Block, Details, Fact, Figure, Page, Section, Text, Verdict
from .drawing import AFTER
from .verdict import fit, times
from .words import find_missing, joined


@dataclass(frozen=True)
class Said:
    """A judgement as a page says it: the badge, whether it is good, and a clause for the headline."""

    badge: str
    good: bool
    words: str


_SAID = {
    Adequacy.UNKNOWN: Said("Cannot be judged", False, "These logs cannot judge the model"),
    Adequacy.ADEQUATE: Said("Adequate", True, "The model is adequate"),
    Adequacy.SMALL: Said("Something small is missing", False, "The model misses something small"),
    Adequacy.INADEQUATE: Said("Not adequate", False, "The model is not adequate"),
}


def adequacy(gap: Gap) -> Said:
    """What the error over the noise floor says of a plant."""
    return _SAID[gap.judgement.adequacy]


def validation_page(
    gap: Gap,
    plant: Plant,
    logs: Sequence[Log],
    name: str,
    look: str,
    seen: Sequence[str] = (),
    parts: Parts | None = None,
) -> Page:
    """The report of a validation. name: of the plant file; look: the command that looks for what it misses; seen: logs
    among these that the plant was fitted to; parts: of the gap, where there are several logs."""
    sources = [log.source for log in logs]
    judged = adequacy(gap)
    doubts = doubts_of(gap)
    if seen:
        by_hand = f", then moved by hand ({spoken(moved)})" if (moved := plant.moved_by_hand) else ""
        fitted = f"{joined(seen, 'and')}: the plant was fitted to it{by_hand}, so this is no test on held-out data."
        doubts = (fitted, *doubts)
    use = "Use the plant in motions like these; `furuta compare` designs and compares controllers on it."
    verdict = Verdict(
        judged.badge,
        judged.good,
        f"{judged.words}: {error_in_words(gap, 'these logs')}",
        doubts,
        facts(gap),
        use if judged.good else find_missing(look),
        effects_of(plant),
    )
    kicker = f"furuta validate · {name} · {joined(sources, 'and')}"
    return Page("Validation", kicker, verdict, (*gap_sections(gap, logs, parts), about(logs, "predicted")), footer())


def error_in_words(gap: Gap, where: str) -> str:
    """The error as the headline says it."""
    digits = f"{gap.ratio_to_floor:.2f}" if gap.ratio_to_floor < SMALL_BELOW else times(gap.ratio_to_floor)
    return f"{gap.horizon:g}\u00a0s ahead on {where}, its error is {digits} times the noise floor."


def facts(gap: Gap) -> tuple[Fact, ...]:
    """The numbers of the first screen."""
    ahead = f"{gap.horizon:g} s ahead"
    unit = f"rms of q1 and q2, {ahead}"
    if np.all(gap.counts > 0):
        counts = gap.rms / gap.counts
        unit += f"; {number(float(counts[0]))} and {number(float(counts[1]))} counts"
    rms = " and ".join(number(1e3 * float(r)) for r in gap.rms)
    return (
        Fact("Gap, times the noise floor", f"{gap.ratio_to_floor:.2f} ×", f"{ahead}; 1 is perfect"),
        Fact("Fit", fit(gap.fit_percent), f"of q1 and q2, {ahead}; a right plant: {fit(gap.fit_at(gap.floor))}"),
        Fact("Error", f"{rms} mrad", unit),
    )


def doubts_of(gap: Gap) -> tuple[str, ...]:
    """What to doubt where the noise floor cannot be trusted."""
    said = [gap.verdict] if gap.judgement.floor_in_doubt else []
    said += [gap.at_rest] if gap.at_rest and not gap.says_little else []
    return tuple(f"{doubt[:1].upper()}{doubt[1:]}." for doubt in said)


def effects_of(plant: Plant) -> tuple[Block, ...]:
    """What the plant has beside model (5)."""
    if not plant.effects:
        return ()
    said = ". ".join(effect.sentence(plant.unit) for effect in plant.effects)
    return (Text(f"The plant has this beside model (5): {said}.", "quiet"),)


def gap_sections(gap: Gap, logs: Sequence[Log], parts: Parts | None = None) -> tuple[Section, ...]:
    """Predictions over measurements, and residuals; parts: of the gap, by log and by kind of experiment."""
    side = prediction_figures.Side("predicted", gap, AFTER)
    source = "the spread of the repeated runs" if gap.repeats else "what readings and torque noise leave"
    floor = f"The noise floor is {source} if the plant is right."
    if changed := gap.changed:
        floor += f" {changed[:1].upper()}{changed[1:]}."
    table = tables.gap(gap)
    return (
        Section(
            "measured",
            "Measured over predicted",
            (Figure(prediction_figures.predictions(logs, [side])), *_in_parts(parts)),
        ),
        Section(
            "residuals",
            "Residuals",
            (
                Figure(prediction_figures.horizons([side])),
                Text(floor),
                Figure(prediction_figures.residuals(gap)),
                Details("Errors with intervals, tests of the residuals", (table, tables.innovation_tests(gap))),
            ),
        ),
    )


def _in_parts(parts: Parts | None) -> tuple[Block, ...]:
    if parts is None:
        return ()
    kinds = (tables.by_kind(parts.by_kind),) if parts.by_kind else ()
    return (tables.by_log(parts.by_log), *kinds)


def about(logs: Sequence[Log], use: str) -> Section:
    """The logs behind a page."""
    return Section("about", "The logs", (tables.logs(logs, use=use),))


def footer() -> tuple[Block, ...]:
    """What made the page."""
    return (Text(f"furuta-gym {version('furuta-gym')}"),)
