"""Whether all logs of a diagnosis are of one plant. What changed on the rig between two logs passes for an effect."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from functools import partial

import numpy as np

from ..estimation.estimate import Estimate
from ..estimation.identify import identify
from ..logs.checks import LogWarning
from ..logs.log import Log
from ..validation.gap import validate
from ..validation.one_rig import OneByOne, apart, explained_below
from .held_out import HeldOut
from .outcome import Diagnosis


def first_alone(logs: Sequence[Log], found: OneByOne) -> tuple[Log, ...]:
    """Of searched logs that are of different plants the first; all, where only held-out logs are of another one."""
    return tuple(logs[:1] if found.sources == tuple(log.source for log in logs) else logs)


def different_plants(diagnosis: Diagnosis, held: HeldOut) -> OneByOne | None:
    """Fits of the searched logs one by one, or of searched and held-out logs apart, where all together are not
    explained with the effects found, each is by itself, and all are likelier so by more than the further parameters
    bring by chance; else None.

    What follows the clock of its log differs from log to log anyway: held-out logs then say nothing. Names that
    these have taken back stay so: what is predicted worse with a name is no reason to keep it.
    """
    before, after = diagnosis.before, diagnosis.after
    if before is None or after is None:
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LogWarning)  # that zeros lie apart: of fits that nobody sees
        if (found := _searched(after, held)) is not None or diagnosis.timed or not diagnosis.confirmed:
            return found
        return _held_out(diagnosis, before, after, held)


def _searched(after: Estimate, held: HeldOut) -> OneByOne | None:
    """With model (5), as what differs may have passed for effects; else, where all together are not explained, with
    the effects found."""
    if len(held.logs) < 2:
        return None
    try:
        ratio = validate(after.plant, held.logs).ratio_to_floor
    except ValueError:  # too short
        return None
    parts = [(log.source, (log,)) for log in held.logs]
    plain = [after.plant.replace(effects=())] if after.plant.effects else []
    for structure in plain if ratio <= held.policy.adequate else [*plain, after.plant]:
        rough = partial(identify, start=structure, polished=False, model_error=False)
        found = apart(parts, ratio, rough, held.policy.adequate)
        if found is not None and likelier(found.estimates, after) > held.policy.believed:
            # error bars tell what differs
            return apart(parts, ratio, partial(identify, start=structure), held.policy.adequate)
    return None


def _held_out(diagnosis: Diagnosis, before: Estimate, after: Estimate, held: HeldOut) -> OneByOne | None:
    """The same, with what the search has fitted to the searched logs: most are not explained, which takes no fit."""
    gap, far, adequate = diagnosis.gap, held.policy.far, held.policy.adequate
    if not held.whole or gap is None or gap.after_over_floor <= far or diagnosis.uncertain:  # one plant explains all
        return None
    parts = [("the searched logs", held.logs), ("the held-out logs", held.whole)]
    for searched in (before, after) if diagnosis.added else (after,):

        def fitted(logs: Sequence[Log], searched: Estimate = searched, shown: bool = True) -> Estimate:
            if logs is held.logs:
                return searched
            return identify(logs, searched.plant, polished=shown, model_error=shown)

        found = apart(parts, gap.after_over_floor, partial(fitted, shown=False), adequate)
        if found is None:
            continue
        joint = held.jointly(after.plant)
        if joint is None or joint[1] <= far:
            return None
        if (
            max(found.ratios) <= explained_below(joint[1], adequate)
            and likelier(found.estimates, joint[0]) > held.policy.believed
        ):
            return apart(parts, joint[1], fitted, adequate)
    return None


def likelier(estimates: Sequence[Estimate], joint: Estimate) -> float:
    """Log-likelihood [nats] that fits of the parts gain on one fit to all, less half the logarithm of the samples for
    each further parameter (Schwarz 1978)."""
    gain = sum(e.log_likelihood for e in estimates) - joint.log_likelihood
    further = sum(len(e.optimum.z) for e in estimates if e.optimum) - (len(joint.optimum.z) if joint.optimum else 0)
    return gain - 0.5 * np.log(joint.samples) * further
