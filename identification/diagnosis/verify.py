"""Verify the effects found: how much of the gap closes on data that no fit has seen, and what that means."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache

from furuta_gym.plant import Effect

from ..estimation.estimate import Estimate
from ..estimation.identify import identify
from ..estimation.zeros import moved
from ..kalman.noise import LostLog
from ..kalman.noise_model import unexplained_torque
from . import sentences
from .gap_change import GapChange, speaks_against
from .held_out import HeldOut
from .locate.locate import locate
from .naming.certain import may_be_absent
from .naming.fits import turning_speed
from .origin import with_origin
from .outcome import Diagnosis


def verified(diagnosis: Diagnosis, held: HeldOut) -> Diagnosis:
    """The diagnosis in the light of data that no fit saw: with its gap, names taken back that do not hold there.

    Where no gap can be had, the verdict stays and `gap_remark` says why. What was found is not dropped as needless
    where the plant without it leaves structure that matters: nothing named beside that would be "unknown".
    """
    if diagnosis.before is None or diagnosis.after is None:
        return diagnosis
    try:
        gap = measure_gap(diagnosis, held)
    except LostLog as error:
        lost = replace(diagnosis, gap_remark=str(error))
        if not diagnosis.added or (held.whole and diagnosis.timed) or not held.follows(diagnosis.before.plant):
            return lost
        together = held.together(diagnosis.after.plant)
        return lost if together is not None and together <= diagnosis.policy.far else lost.vetoed()
    except ValueError as error:
        return replace(diagnosis, gap_remark=str(error))
    at_the_floor = gap.before.at_the_floor(diagnosis.policy.adequate)
    if _sharpness_alone(diagnosis):
        if at_the_floor:
            told = sentences.only_sharpness(gap.before.ratio_to_floor)
            without = _with_free_sharpness(diagnosis, held, gap, told)
            if not without.leftover:
                return without
        elif (fitted := _with_usual_sharpness(diagnosis, held, gap)) is not None:
            return fitted
    if not diagnosis.leftover and _of_no_size(diagnosis) and at_the_floor:
        told = sentences.of_no_size([effect.name for effect in diagnosis.named], gap.before.ratio_to_floor)
        without = _with_nothing(diagnosis, diagnosis.before, held, held.change(gap.before, gap.before), told)
        if not without.leftover:
            return without
    plant = (diagnosis.after if diagnosis.added else diagnosis.before).plant
    return judged(replace(diagnosis, gap=gap), gap, lambda: held.together(plant))


def _of_no_size(diagnosis: Diagnosis) -> bool:
    """Whether something was found, and each may be absent. The logs are likelier with it then, but what the model lacks
    anyway may pass for it."""
    assert diagnosis.after is not None
    plant = diagnosis.after.plant
    return bool(diagnosis.found) and all(
        may_be_absent(plant, effect.name, diagnosis.policy.present) for effect in diagnosis.found
    )


def _sharpness_alone(diagnosis: Diagnosis) -> bool:
    """Whether all that was found is another sharpness r of friction, or friction that is another nearer to rest than
    its sharpness shows. No rig has the paper's r, so another one is worth a name only where it shows in predictions and
    is far from it, or leaves structure."""
    if len(diagnosis.found) != 1 or diagnosis.leftover or diagnosis.after is None:
        return False
    (found,), plant = diagnosis.found, diagnosis.after.plant
    effect, slowest = plant.effect(found.name), turning_speed(plant, found.name, diagnosis.policy.turned)
    speeds = [] if effect is None else [effect.parameters[p.name] for p in effect.type.parameters if p.near_rest]
    return found.type.sharpens or any(speed < slowest for speed in speeds)


def _with_usual_sharpness(diagnosis: Diagnosis, held: HeldOut, gap: GapChange) -> Diagnosis | None:
    """Model (5) with its r fitted, where both joints' sharpness is near the paper's and one r may be that of both, or
    predicts as well: then r is the parameter that `identify` estimates, and nothing is missing. None elsewhere."""
    assert diagnosis.after is not None
    apart, factor = diagnosis.after.plant.sharpening, diagnosis.policy.usual_sharpness
    low, high = diagnosis.policy.sharpness / factor, diagnosis.policy.sharpness * factor
    if apart is not None and not all(low <= r <= high for r in apart.parameters.values()):
        return None
    fitted = _with_free_sharpness(diagnosis, held, gap, "")
    found, change = fitted.before, fitted.gap
    assert found is not None
    assert change is not None
    ratio = change.before.ratio_to_floor
    one_r = _one_value(apart) if apart is not None else False
    if fitted.leftover or (not one_r and ratio > diagnosis.policy.adequate * gap.after.ratio_to_floor):
        return None
    if apart is None and not all(low <= r <= high for r in found.plant.sharpness):
        return None
    told = sentences.usual_sharpness(
        found.plant.sharpness[0], diagnosis.policy.sharpness, ratio if ratio <= diagnosis.policy.far else None
    )
    return judged(replace(fitted, summary=told), change, lambda: held.together(found.plant))


def _one_value(effect: Effect) -> bool:
    """Whether the parameters of an effect may share one value: their 95 % intervals overlap."""
    ends = [between for name in effect.parameters if (between := effect.interval(name))]
    return max((low for low, _ in ends), default=0.0) <= min((high for _, high in ends), default=0.0)


def _with_free_sharpness(diagnosis: Diagnosis, held: HeldOut, gap: GapChange, summary: str) -> Diagnosis:
    """Nothing is named; r is a parameter like the others."""
    assert diagnosis.before is not None
    try:
        fitted = with_origin(identify(held.logs, diagnosis.before.plant), diagnosis.before.plant)
        again = held.gap(fitted.plant)
    except ValueError:  # then the paper's r is as good
        fitted, again = diagnosis.before, gap.before
    return _with_nothing(diagnosis, fitted, held, held.change(again, again), summary)


def _with_nothing(diagnosis: Diagnosis, fitted: Estimate, held: HeldOut, gap: GapChange, summary: str) -> Diagnosis:
    """The diagnosis without a name: the plant is that of `fitted`, before and after, and so is what is left."""
    assert diagnosis.naming is not None
    found = diagnosis.naming
    naming = replace(found, found=(), rejected=found.rankings, final=found.nominal)
    told = replace(diagnosis, verdict="none", summary=summary, before=fitted, after=fitted, naming=naming, gap=gap)
    rest = locate(fitted.plant, moved(held.logs, fitted.zeros), diagnosis.policy)
    left = unexplained_torque(fitted.noise.torque[0]) if fitted.noise else diagnosis.left_over
    return replace(told, rest=rest, left_over=left)


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
        named = diagnosis.after.plant, None, None, math.inf
    else:  # the first part of the logs is fitted anew anyway
        named = final.plant, final.noise, final.zeros, math.inf
    before, after = held.gaps((diagnosis.before.plant, None, None, math.inf), named)
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
            names = [effect.name for effect in diagnosis.found if effect.type.follows_clock]
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
