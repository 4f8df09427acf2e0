"""Verify the effects found: how much of the gap closes on data that no fit has seen, and what that means."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import Plant

from ..estimation.identify import identify
from ..estimation.zeros import moved
from ..logs.log import Log
from ..validation.gap import ClosedFraction, Gap, closed_fraction, validate
from .gap_change import GapChange
from .outcome import Diagnosis
from .policy import DecisionPolicy

Array = NDArray[np.float64]


def verified(diagnosis: Diagnosis, logs: Sequence[Log], held_out: Sequence[Log] = ()) -> Diagnosis:
    """The diagnosis in the light of data that no fit saw: with its gap, names taken back that do not hold there.

    Without held-out logs the last part of each log serves, with plants fitted to the rest. Where no gap can be had,
    the verdict stays and `gap_remark` says why.
    """
    if diagnosis.before is None or diagnosis.after is None:
        return diagnosis
    try:
        gap = measure_gap(diagnosis, logs, held_out)
    except ValueError as error:
        return replace(diagnosis, gap_remark=str(error))
    return judged(replace(diagnosis, gap=gap), gap)


def measure_gap(diagnosis: Diagnosis, logs: Sequence[Log], held_out: Sequence[Log] = ()) -> GapChange:
    """The gap of the plants before and after on held-out logs or, without any, on the last part of the fitted ones.

    Raises ValueError where there is no plant, the logs are too short, or their first part alone cannot be fitted.
    """
    if diagnosis.before is None or diagnosis.after is None:
        raise ValueError("there is no plant to predict with")
    tail = diagnosis.policy.tail
    plants = [diagnosis.before.plant, diagnosis.after.plant] if diagnosis.added else [diagnosis.before.plant]
    if held_out:
        gaps = [validate(plant, held_out) for plant in plants]
    else:
        heads = [log.split(1.0 - tail)[0] for log in logs]
        # from the noise that the search ended with: from more of it, a fit loses what is small against it again
        noises = [None, diagnosis.naming.final.noise if diagnosis.naming else None]
        starts = [None, diagnosis.naming.final.zeros if diagnosis.naming else None]
        refitted = [
            identify(heads, _as_start(p), noise=noise, zeros=zeros if noise else None)
            for p, noise, zeros in zip(plants, noises, starts, strict=False)
        ]
        gaps = [_of_tails(e.plant, moved(logs, e.zeros), tail) for e in refitted]
    before, after = gaps[0], gaps[-1]
    closed = closed_fraction(before, after) if len(gaps) > 1 else ClosedFraction(0.0, (0.0, 0.0))
    own_tail = _own_tail(diagnosis, logs) if held_out and diagnosis.repeating else None
    return GapChange(before, after, closed, tuple(held_out or logs), None if held_out else tail, own_tail)


def _own_tail(diagnosis: Diagnosis, logs: Sequence[Log]) -> GapChange | None:
    try:
        return measure_gap(diagnosis, logs)
    except ValueError:  # too short, or its first part alone cannot be fitted
        return None


def speaks_against(gap: GapChange, policy: DecisionPolicy) -> bool:
    """Whether held-out data speak against the effects found: the gap grows for certain, or it closes for certain
    neither there nor in the likelihood."""
    low, high = gap.closed.interval
    return gap.changed and (high <= 0.0 or not (low > 0.0 or gap.likelier > policy.likelier))


def judged(diagnosis: Diagnosis, gap: GapChange) -> Diagnosis:
    """The diagnosis in the light of held-out data: names taken back, or what they leave of the gap.

    Effects that follow a log's own clock are judged on its tail only: where that is held out, or if they repeat.
    """
    witness = gap.own_tail if gap.tail is None and diagnosis.timed else gap
    if witness is None or not witness.changed:
        return diagnosis
    if speaks_against(witness, diagnosis.policy):
        return diagnosis.vetoed()
    far = witness.after_over_floor > diagnosis.policy.far
    return diagnosis.falling_short(witness.after_over_floor) if far else diagnosis


def _as_start(plant: Plant) -> Plant:
    return plant.replace(covariance=None, checks={}, provenance={})


def _of_tails(plant: Plant, logs: Sequence[Log], tail: float) -> Gap:
    """The gap in the windows that lie in the last part of each log. The filter runs from the start, so that what
    changes with time is predicted at its time."""
    gap = validate(plant, logs, own_zeros=False)
    cut = np.array([log.t[0] + (1.0 - tail) * log.duration for log in logs])
    late = gap.times - gap.horizon >= cut[gap.log]
    if late.sum() < 10:
        raise ValueError(f"the last {100 * tail:.0f} % of the logs are too short for prediction over {gap.horizon:g} s")
    errors = gap.errors[late]
    rms = np.sqrt(np.mean(errors**2, axis=0))
    reading = np.concatenate([readings_at(logs[i], gap.times[late & (gap.log == i)]) for i in range(len(logs))])
    size = np.maximum(np.sqrt(np.mean((reading - reading.mean(axis=0)) ** 2, axis=0)), 1e-12)
    return replace(
        gap,
        rms=rms,
        fit_percent=100.0 * (1.0 - rms / size),
        curve=np.concatenate([[gap.horizon], rms, gap.floor])[None],
        errors=errors,
        times=gap.times[late],
        log=gap.log[late],
        surprise=gap.surprise[gap.surprise[:, 1] >= cut[gap.surprise[:, 0].astype(int)]],
    )


def readings_at(log: Log, times: Array) -> Array:
    """Readings (M, 2) of a log at some of its own stamps (M,)."""
    return log.angles[np.clip(np.searchsorted(log.t, times - 1e-9), 0, len(log) - 1)]
