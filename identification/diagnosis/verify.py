"""How much of the gap closes when the effects found are added, on data that no fit has seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import Plant
from identification.diagnosis.diagnose import Diagnosis

from ..estimation.identify import identify
from ..logs.log import Log
from ..validation.gap import ClosedFraction, Gap, closed_fraction, validate

AXES = ("arm q1", "pendulum q2")
TAIL = 0.3  # of each log, held out where there is no other log
FAR = 1.5  # times the floor: an error of this size that is left says that more is missing
LIKELIER = 10.0  # nats on data that no fit saw, from which effects count as confirmed: as for naming them

Array = NDArray[np.float64]


@dataclass(frozen=True)
class GapChange:
    """Prediction errors before and after, on the same windows.

    closed: share of the squared gap above the floor that closed; 0 where nothing was added. tail: share of each
    fitted log that was held out (both plants fitted anew to the rest), or None where whole logs were. own_tail: the
    same on such tails, beside whole logs that cannot speak about effects which repeat by the clock of their own log.
    """

    before: Gap
    after: Gap
    closed: ClosedFraction
    logs: tuple[Log, ...]
    tail: float | None
    own_tail: GapChange | None = None

    @property
    def changed(self) -> bool:
        return self.after is not self.before

    @property
    def sides(self) -> tuple[tuple[str, Gap], ...]:
        """What there is to compare, with names."""
        return (("before", self.before), ("after", self.after)) if self.changed else (("model (5)", self.before),)

    @property
    def likelier(self) -> float:
        """Log-likelihood [nats] that the effects gain on these data, one step ahead. No parameter was fitted to them,
        so there is no price; finer than `closed`, and what tells where the gap itself is lost in noise."""
        return float(np.sum(self.before.surprise[:, 2]) - np.sum(self.after.surprise[:, 2]))

    @property
    def floor(self) -> Array:
        """(2,) [rad] at the horizon: the lower of the two, as what a wrong plant misses can only raise it."""
        return np.minimum(self.before.floor, self.after.floor)

    @property
    def after_over_floor(self) -> float:
        return self.over_floor(self.after)

    def over_floor(self, side: Gap) -> float:
        """Root mean square over the axes of a side's error over the floor that both share."""
        return float(np.sqrt(np.mean((side.rms / self.floor) ** 2)))

    def to_dict(self) -> dict[str, Any]:
        """As the "gap" of diagnosis.json, and more."""
        sides = {
            side: {"rms_q1": float(gap.rms[0]), "rms_q2": float(gap.rms[1]), "ratio_to_floor": self.over_floor(gap)}
            for side, gap in (("before", self.before), ("after", self.after))
        }
        return sides | {
            "noise_floor": {"rms_q1": float(self.floor[0]), "rms_q2": float(self.floor[1])},
            "closed_fraction": self.closed.value,
            "closed_interval": list(self.closed.interval),
            "log_likelihood_gain": self.likelier,
            "held_out": self.tail is None,
            "tail": self.tail,
            "own_tail": self.own_tail.to_dict() if self.own_tail else None,
            "horizon_s": self.before.horizon,
            "logs": [log.source for log in self.logs],
        }


def added(diagnosis: Diagnosis) -> bool:
    """Whether the plant after the search has effects that the one before lacks."""
    before, after = diagnosis.before, diagnosis.after
    if before is None or after is None:
        return False
    return {e.name for e in after.plant.effects} != {e.name for e in before.plant.effects}


def measure_gap(diagnosis: Diagnosis, logs: Sequence[Log], held_out: Sequence[Log] = ()) -> GapChange:
    """The gap of the plants before and after on held-out logs or, without any, on the last part of the fitted ones.

    Raises ValueError where there is no plant, the logs are too short, or their first part alone cannot be fitted.
    """
    if diagnosis.before is None or diagnosis.after is None:
        raise ValueError("there is no plant to predict with")
    plants = [diagnosis.before.plant, diagnosis.after.plant] if added(diagnosis) else [diagnosis.before.plant]
    if held_out:
        gaps = [validate(plant, held_out) for plant in plants]
    else:
        heads = [log.split(1.0 - TAIL)[0] for log in logs]
        # from the noise that the search ended with: from more of it, a fit loses what is small against it again
        noises = [None, diagnosis.naming.final.noise if diagnosis.naming else None]
        refitted = [identify(heads, _as_start(p), noise=noise).plant for p, noise in zip(plants, noises, strict=False)]
        gaps = [_of_tails(plant, logs) for plant in refitted]
    before, after = gaps[0], gaps[-1]
    closed = closed_fraction(before, after) if len(gaps) > 1 else ClosedFraction(0.0, (0.0, 0.0))
    own_tail = _own_tail(diagnosis, logs) if held_out and diagnosis.repeating else None
    return GapChange(before, after, closed, tuple(held_out or logs), None if held_out else TAIL, own_tail)


def _own_tail(diagnosis: Diagnosis, logs: Sequence[Log]) -> GapChange | None:
    try:
        return measure_gap(diagnosis, logs)
    except ValueError:  # too short, or its first part alone cannot be fitted
        return None


def brings_nothing(gap: GapChange) -> bool:
    """Whether held-out data speak against the effects found: the gap grows for certain, or it closes for certain
    neither there nor in the likelihood."""
    low, high = gap.closed.interval
    return gap.changed and (high <= 0.0 or not (low > 0.0 or gap.likelier > LIKELIER))


def judged(diagnosis: Diagnosis, gap: GapChange) -> Diagnosis:
    """The diagnosis in the light of held-out data: names taken back, or what they leave of the gap.

    Effects that follow a log's own clock are judged on its tail only: where that is held out, or if they repeat.
    """
    witness = gap.own_tail if gap.tail is None and diagnosis.timed else gap
    if witness is None or not witness.changed:
        return diagnosis
    if brings_nothing(witness):
        return diagnosis.vetoed()
    return diagnosis.falling_short(witness.after_over_floor) if witness.after_over_floor > FAR else diagnosis


def _as_start(plant: Plant) -> Plant:
    return plant.replace(covariance=None, checks={}, provenance={})


def _of_tails(plant: Plant, logs: Sequence[Log]) -> Gap:
    """The gap in the windows that lie in the last part of each log. The filter runs from the start, so that what
    changes with time is predicted at its time."""
    gap = validate(plant, logs)
    cut = np.array([log.t[0] + (1.0 - TAIL) * log.duration for log in logs])
    late = gap.times - gap.horizon >= cut[gap.log]
    if late.sum() < 10:
        raise ValueError(f"the last {100 * TAIL:.0f} % of the logs are too short for prediction over {gap.horizon:g} s")
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


def rms_interval(gap: Gap, seed: int = 0, draws: int = 500, block: float = 1.0) -> Array:
    """95 % interval (2, 2) [rad], axis by low and high, of the rms error, by a bootstrap over blocks of time [s]."""
    _, group = np.unique(np.stack([gap.log, np.floor(gap.times / block)]), axis=1, return_inverse=True)
    group = group.ravel()
    groups = int(group.max()) + 1
    columns = (*(gap.errors**2).T, np.ones(len(gap.errors)))
    sums = np.stack([np.bincount(group, x, groups) for x in columns])
    picked = np.random.default_rng(seed).integers(0, groups, (draws, groups))
    drawn = sums[:, picked].sum(axis=2)
    return np.quantile(np.sqrt(drawn[:2] / drawn[2]), [0.025, 0.975], axis=1).T
