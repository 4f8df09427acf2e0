"""The last resort: a torque on the arm learned from what names leave, kept only if it holds in another experiment.

Names come first, always: nothing is learned before every effect of the library has been tried, and what was learned
changes no verdict.
"""

from __future__ import annotations

from dataclasses import replace

from furuta_gym.plant import Plant

from ..discrepancy.learned import most_likely_surface
from ..estimation.identify import identify
from ..estimation.zeros import moved
from ..kalman.coordinates import Zeros
from ..kalman.noise_model import Noise
from ..kalman.record import stretches
from ..logs.kind import kind_of
from .gap_change import GapChange, closes
from .held_out import HeldOut
from .learned import Learned
from .origin import with_origin
from .outcome import Diagnosis


def with_learned(diagnosis: Diagnosis, held: HeldOut) -> Diagnosis:
    """The diagnosis with a torque learned from what its plant leaves, where that matters: more than noise is left of
    the fitted logs, or held-out data are predicted much worse than noise would.

    A plant of the second witness keeps its θ."""
    plant, rest = diagnosis.plant, diagnosis.rest
    if plant is None or rest is None or not (rest.matters or diagnosis.still_off > 1.0):
        return diagnosis
    estimate = diagnosis.after if diagnosis.confirmed else diagnosis.before
    assert estimate is not None
    try:
        learned = learned_from(plant, estimate.zeros, held, _noise_of(diagnosis), refitted=plant is estimate.plant)
    except ValueError:  # the filter loses a log: nothing to learn from
        return diagnosis
    if learned is None:
        return diagnosis
    became = "is part of the plant written" if learned.added else "was refused"
    summary = f"{diagnosis.summary} A torque learned over the arm's angle and speed {became}: {learned.reason}."
    return replace(diagnosis, learned=learned, summary=summary)


def _noise_of(diagnosis: Diagnosis) -> Noise | None:
    naming = diagnosis.naming
    return None if naming is None else (naming.final if diagnosis.confirmed else naming.nominal).noise


def learned_from(
    plant: Plant, zeros: Zeros, held: HeldOut, noise: Noise | None = None, refitted: bool = True
) -> Learned | None:
    """The torque that a plant lacks on the arm, learned from the fitted logs and judged by the held-out ones.

    zeros: of the fitted logs' encoders. noise: of the plant's fit, from which the next goes on. refitted: whether θ is
    estimated again beside it, where anything can come of it. None where the logs ask for no such torque. Raises
    ValueError if the filter loses a log.
    """
    records = [stretch.record for stretch in stretches(moved(held.logs, zeros))]
    surface = most_likely_surface(plant, records, refitted)
    if surface.evidence < held.policy.believed:
        return None
    found = plant.with_effects(surface.effect)
    if reason := _no_judge(held):
        return Learned(found, surface.evidence, None, False, reason)
    if refitted:
        bare = found.without_fit()
        found = with_origin(identify(held.logs, bare, noise=noise, zeros=zeros), plant).plant
    change, reason = _judged(plant, found, held)
    return Learned(found, surface.evidence, change, not reason, reason or _praise(change))


def _no_judge(held: HeldOut) -> str:
    """Why the held-out logs cannot say whether what is learned holds; empty if they can."""
    if not held.whole:
        return "no other log of this rig was held out, and one log cannot tell whether it holds elsewhere"
    fitted = {kind_of(log) for log in held.logs}
    if all(kind_of(log) in fitted for log in held.whole):
        return "no held-out log is of another kind of experiment, and one kind cannot tell whether it holds"
    return ""


def _judged(plant: Plant, found: Plant, held: HeldOut) -> tuple[GapChange | None, str]:
    """How the gap changes, and why the torque is not added; an empty reason if it is."""
    try:
        change = held.change(held.gap(plant), held.gap(found))
    except ValueError as error:
        return None, f"held-out data could not be predicted with it: {error}"
    fitted = {kind_of(log) for log in held.logs}
    others = [part for part in change.by_kind if part.name not in fitted]
    if not others:
        return change, "the held-out logs of another kind of experiment are too short to judge it"
    if worse := [part.name for part in change.by_kind if part.over_floor[1] > part.over_floor[0]]:
        return change, f"the error on held-out data grows: {', '.join(worse)}"
    if open_ones := [part.name for part in others if not part.closed.interval[0] > 0.0]:
        return change, f"it closes nothing for certain where the experiment is another: {', '.join(open_ones)}"
    if not closes(change, held.policy):
        return change, f"its closed share is {100 * change.closed.value:.2g} %, too little to be worth it"
    return change, ""


def _praise(change: GapChange | None) -> str:
    assert change is not None
    before, after = change.over_floor(change.before), change.over_floor(change.after)
    return (
        f"it holds on held-out data of another kind of experiment: the error falls from {before:.2g} to "
        f"{after:.2g} times the noise floor"
    )
