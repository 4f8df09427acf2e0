"""The page of `furuta identify`: is the model adequate, what are its parameters, and how sure are they?"""

from __future__ import annotations

import shlex
from collections.abc import Sequence

from identification.estimation.estimate import Estimate
from identification.estimation.identifiability import spoken
from identification.logs.log import Log
from identification.validation.gap import Gap

from . import search_figures, tables
from .contents import Block, Fact, Figure, Page, Section, Text, Verdict
from .validation_page import Said, about, adequacy, doubts_of, effects_of, error_in_words, facts, footer, gap_sections
from .words import by_name, find_missing, joined, opening

_FITTED = "These logs were fitted. The test is a log that was not."


def estimate_page(
    estimate: Estimate,
    logs: Sequence[Log],
    gap: Gap | None,
    remark: str,
    plant_file: str,
    typed: str | None = None,
    options: str = "",
) -> Page:
    """The report of an identification. gap: of the estimated plant on the fitted logs, or None with the reason in
    `remark`; plant_file: what the plant was saved as. typed: the logs as the command line has them, with the options
    that read them (default: by their names); options: those alone, each after a space."""
    sources = joined([log.source for log in logs], "and")
    unidentified = estimate.identifiability.unidentified
    lost, weak = spoken(unidentified), spoken(estimate.identifiability.weak)
    known = f"{len(estimate.names) - len(unidentified)} of {len(estimate.names)}"
    judged = adequacy(gap) if gap is not None else None
    if gap is None or judged is None:
        badge, good, headline = (
            "Identified",
            estimate.valid,
            "The parameters were identified; the error was not measured.",
        )
        doubts: list[str] = [f"{opening(remark)}."]
    else:
        badge, good = judged.badge, judged.good and estimate.valid
        headline = f"{judged.words}: {error_in_words(gap, 'the fitted logs')}"
        doubts = [*doubts_of(gap), _FITTED]
    if not estimate.converged:
        doubts.insert(0, f"The fit did not converge: {estimate.message}.")
    if lost:
        doubts.append(f"Not identified: {lost}. The section on parameters says what would help.")
    if weak:
        doubts.append(f"Weak: {weak}. The section on parameters says what would help.")
    numbers = (
        *(facts(gap) if gap is not None else ()),
        Fact("Parameters", known, "identified; weak ones count"),
    )
    fitted = by_name(logs) if typed is None else typed
    checked = f"{shlex.quote(plant_file)} LOG{options}"
    verdict = Verdict(
        badge, good, headline, tuple(doubts), numbers, _next(judged, fitted, checked), effects_of(estimate.plant)
    )
    return Page(
        "Identification",
        f"furuta identify · {sources}",
        verdict,
        (_parameters(estimate), *(gap_sections(gap, logs) if gap is not None else ()), about(logs, "fitted")),
        footer(),
    )


def _next(judged: Said | None, fitted: str, checked: str) -> str:
    if judged is None or judged.good:
        return f"Record a log of another kind of motion and run `furuta validate {checked}`."
    look = find_missing(f"furuta diagnose {fitted} -o diagnosis")
    return f"{look} Hold another log out, if there is one: `--held-out LOG`."


def _parameters(estimate: Estimate) -> Section:
    blocks: list[Block] = [Figure(search_figures.precision(estimate)), tables.parameters(estimate, estimate, False)]
    said = [*estimate.identifiability.advice, *estimate.warnings]
    if estimate.u_max_guessed:
        said.append(f"{estimate.u_max_told}; set it with `--u-max`")
    blocks += [Text(f"{opening(text)}.", "note") for text in said]
    return Section("parameters", "Parameters", tuple(blocks))
