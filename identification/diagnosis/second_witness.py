"""A second witness where names leave much, or might: the same structure fitted by multiple shooting.

Where both fits disagree beyond their errors, torque noise hides structure that the model lacks. The plant that predicts
data which no fit saw better for certain is the one to use.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..estimation.estimate import Estimate
from ..validation.shooting import Shooting, shooting
from .held_out import HeldOut
from .outcome import Diagnosis, SecondWitness


def with_second_witness(diagnosis: Diagnosis, held: HeldOut) -> Diagnosis:
    """The diagnosis with the plant after the search fitted by multiple shooting as well, if held-out logs are still
    predicted much worse than noise would, or the noise that they are measured by is nearly all torque noise. Without
    such logs nobody could say which plant is better. Names that were taken back are in no plant to be fitted."""
    after = diagnosis.after
    if after is None or diagnosis.gap is None or not held.whole or not diagnosis.confirmed:
        return diagnosis
    if diagnosis.still_off <= 1.0 and not diagnosis.torque_floor_exceeded:
        return diagnosis
    try:
        shot = shooting(after.plant, held.logs, after.zeros)
        change = held.change(diagnosis.gap.after, held.gap(shot.plant))
    except ValueError:  # too short, or lost: no second witness then
        return diagnosis
    plant = shot.plant.replace(provenance=dict(after.plant.provenance) | {"method": "multiple shooting"})
    second = SecondWitness(
        plant, _disagreeing(after, shot, held.policy.disagree), change, better=bool(change.closed.interval[0] > 0.0)
    )
    summary = diagnosis.summary
    if second.disagreeing:
        told = ", ".join(second.disagreeing)
        summary += (
            f" A second fit, by multiple shooting, disagrees about {told}: the first may have taken a missing torque "
            "for noise."
        )
    if second.better:
        summary += " The plant written is that of multiple shooting, which predicts held-out data better for certain."
        if plant.effects:
            summary += f" In it: {'; '.join(str(effect) for effect in plant.effects)}."
        if not shot.converged:
            summary += " That fit stopped before its optimum."
    return replace(diagnosis, second=second, summary=summary)


def _disagreeing(after: Estimate, shot: Shooting, deviations: float) -> tuple[str, ...]:
    """Parameters about which both fits disagree beyond their errors."""
    found = []
    for name, value, std in zip(shot.names, shot.values, shot.std, strict=True):
        if name in after.names:
            i = after.names.index(name)
            spread = float(np.hypot(std, after.std[i]))
            if np.isfinite(spread) and abs(value - after.values[i]) > deviations * spread:
                found.append(name)
    return tuple(found)
