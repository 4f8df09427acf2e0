"""Verify the effects found: how much of the gap closes on data that no fit has seen, and what that means."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

from ..estimation.identify import identify
from ..validation.adequacy import Adequacy
from . import sentences
from .gap_change import GapChange, speaks_against
from .held_out import HeldOut
from .naming.suspects import follows_clock
from .outcome import Diagnosis


def verified(diagnosis: Diagnosis, held: HeldOut) -> Diagnosis:
    """The diagnosis in the light of data that no fit saw: with its gap, names taken back that do not hold there.

    Where no gap can be had, the verdict stays and `gap_remark` says why.
    """
    if diagnosis.before is None or diagnosis.after is None:
        return diagnosis
    try:
        gap = measure_gap(diagnosis, held)
    except ValueError as error:
        return replace(diagnosis, gap_remark=str(error))
    if _sharper_to_no_effect(diagnosis, gap):
        return _with_free_sharpness(diagnosis, held, gap)
    plant = (diagnosis.after if diagnosis.added else diagnosis.before).plant
    return judged(replace(diagnosis, gap=gap), gap, lambda: held.together(plant))


def _sharper_to_no_effect(diagnosis: Diagnosis, gap: GapChange) -> bool:
    """Whether all that was found is another sharpness r of friction, and model (5) with the paper's r predicts as well
    as noise allows. No rig has that r, so another one is worth a name only where it shows, or leaves structure."""
    alone = [suspect.name for suspect in diagnosis.found] == ["friction_sharpness"]
    return alone and not diagnosis.leftover and gap.before.judgement.adequacy is Adequacy.ADEQUATE


def _with_free_sharpness(diagnosis: Diagnosis, held: HeldOut, gap: GapChange) -> Diagnosis:
    """Nothing is named; r is a parameter like the others."""
    assert diagnosis.before is not None
    assert diagnosis.naming is not None
    try:
        fitted = identify(held.logs, diagnosis.before.plant)
        again = held.gap(fitted.plant)
    except ValueError:  # then the paper's r is as good
        fitted, again = diagnosis.before, gap.before
    naming = replace(diagnosis.naming, accepted=(), equals=(), same=(), final=diagnosis.naming.nominal)
    return replace(
        diagnosis,
        verdict="none",
        summary=sentences.only_sharpness(gap.before.ratio_to_floor),
        before=fitted,
        after=fitted,
        naming=naming,
        gap=held.change(again, again),
    )


def measure_gap(diagnosis: Diagnosis, held: HeldOut) -> GapChange:
    """The gap of the plants before and after on data that no fit saw.

    Raises ValueError where there is no plant, the logs are too short, or their first part alone cannot be fitted.
    """
    if diagnosis.before is None or diagnosis.after is None:
        raise ValueError("there is no plant to predict with")
    if not diagnosis.added:
        before = held.gap(diagnosis.before.plant)
        return held.change(before, before)
    final = diagnosis.naming.final if diagnosis.naming else None
    if held.whole or final is None:
        named = diagnosis.after.plant, None, None
    else:  # the first part of the logs is fitted anew anyway
        named = final.plant, final.noise, final.zeros
    before, after = held.gaps((diagnosis.before.plant, None, None), named)
    change = held.change(before, after)
    plants = (diagnosis.before.plant, diagnosis.after.plant)
    beyond = held.searched_angles(after, plants, diagnosis.after.zeros)
    change = replace(change, searched_angles=beyond)
    if held.whole and diagnosis.repeating:
        change = replace(change, own_tail=_own_tail(diagnosis, held))
    return change


def _own_tail(diagnosis: Diagnosis, held: HeldOut) -> GapChange | None:
    try:
        return measure_gap(diagnosis, HeldOut(held.logs, (), held.policy))
    except ValueError:  # too short, or its first part alone cannot be fitted
        return None


def judged(diagnosis: Diagnosis, gap: GapChange, together: Callable[[], float | None] = lambda: None) -> Diagnosis:
    """The diagnosis in the light of held-out data: names taken back, what they leave of the gap, or that nothing was
    named and the gap is there.

    together() is the error over the noise floor of the plant fitted to all logs, None where nobody can say; it takes
    time, and is asked only if it matters.

    Effects that follow a log's own clock are judged on its tail only: where that is held out, or if they repeat. Where
    held-out logs are predicted worse with them, that is said. What
    depends on the arm's angle stays if held-out logs in which the arm is elsewhere speak against it, but one plant with
    it explains all logs.
    """
    together = cache(together)
    witness = gap.own_tail if gap.tail is None and diagnosis.timed else gap
    if witness is None:
        if gap.likelier < 0.0 and gap.closed.value < 0.0:
            names = [suspect.name for suspect in diagnosis.found if follows_clock(suspect.name)]
            told = sentences.another_clock(names, gap.over_floor(gap.before), gap.after_over_floor)
            return replace(diagnosis, summary=f"{diagnosis.summary} {told}")
        return diagnosis
    far = witness.after_over_floor > diagnosis.policy.far
    if witness.changed and speaks_against(witness, diagnosis.policy):
        mended = None if witness.searched_angles is None else together()
        if mended is None or mended > diagnosis.policy.far:
            return diagnosis.vetoed()
    if not far:
        return diagnosis
    if witness.searched_angles is not None:
        told = sentences.elsewhere(witness.searched_angles)
        diagnosis = replace(diagnosis, summary=f"{diagnosis.summary} {told}")
    askable = diagnosis.verdict != "unknown" and not diagnosis.timed  # other logs have another clock
    return diagnosis.astray(witness.after_over_floor, together() if askable else None)
