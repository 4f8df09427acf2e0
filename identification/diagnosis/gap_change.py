"""How much of the gap closes when effects are added, as a value."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, TypeGuard

import numpy as np
from msgspec import UNSET, UnsetType
from numpy.typing import NDArray

from furuta_gym.declared import written

from ..logs.kind import kind_of
from ..logs.log import Log
from ..validation.closed_fraction import FEWEST_BLOCKS, ClosedFraction, closed_fraction, time_blocks
from ..validation.gap import Gap, over_floor
from .diagnosis_file import Errors, Floors, GapEntry, PartEntry
from .policy import DecisionPolicy

AXES = ("arm q1", "pendulum q2")
_DRAWS, _SEED = 500, 0  # of the bootstrap

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Part:
    """Prediction errors before and after on some of the logs: one of them, or all of one kind of experiment.

    rms_before, rms_after (2,) [rad]: at the horizon, for q1 and q2. over_floor: the same over the floor of these logs
    that both sides share, before and after. closed: share of the squared gap above that floor.
    """

    name: str
    logs: int
    rms_before: Array
    rms_after: Array
    over_floor: tuple[float, float]
    closed: ClosedFraction

    @property
    def grows(self) -> bool:
        """Whether the error grows for certain."""
        return self.closed.interval[1] < 0.0

    def entry(self) -> PartEntry:
        return PartEntry(
            self.name,
            self.logs,
            _errors(self.rms_before),
            _errors(self.rms_after),
            list(self.over_floor),
            self.closed.value,
            list(self.closed.interval),
        )


@dataclass(frozen=True)
class GapChange:
    """Prediction errors before and after, on the same windows.

    closed: share of the squared gap above the floor that closed; 0 where nothing was added. tail: share of each
    fitted log that was held out (both plants fitted anew to the rest), or None where whole logs were. own_tail: the
    same on such tails, beside whole logs that cannot speak about effects which repeat by the clock of their own log.
    searched_angles: where the arm is in the searched logs, from and to [rad], if something depends on its angle and it
    leaves them here; else None.
    """

    before: Gap
    after: Gap
    closed: ClosedFraction
    logs: tuple[Log, ...]
    tail: float | None
    own_tail: GapChange | None = None
    searched_angles: tuple[float, float] | None = None

    @property
    def changed(self) -> bool:
        return self.after is not self.before

    @property
    def sides(self) -> tuple[tuple[str, Gap], ...]:
        """What there is to compare, with names."""
        return (("before", self.before), ("after", self.after)) if self.changed else (("model (5)", self.before),)

    @property
    def likelier(self) -> float:
        """Log-likelihood [nats] that the effects gain on these data, one step ahead; finer than `closed`.

        It tells where the gap itself is lost in noise. Nothing of a plant was fitted to these data, so there is no
        price, but for the arm's zero in each log, which only a plant that depends on the arm's angle has free."""
        gained = float(np.sum(self.before.surprise[:, 2]) - np.sum(self.after.surprise[:, 2]))
        return gained + _price_of_zeros(self.before) - _price_of_zeros(self.after)

    @property
    def floor(self) -> Array:
        """(2,) [rad] at the horizon: the lower of the two, as what a wrong plant misses can only raise it."""
        return np.minimum(self.before.floor, self.after.floor)

    @property
    def after_over_floor(self) -> float:
        return self.over_floor(self.after)

    def over_floor(self, side: Gap) -> float:
        """Root mean square over the axes of a side's error over the floor that both share."""
        return over_floor(side.rms, self.floor)

    @property
    def by_log(self) -> tuple[Part, ...]:
        """Every log by itself."""
        return tuple(self._part(log.source, [i]) for i, log in enumerate(self.logs) if np.any(self.before.log == i))

    @property
    def by_kind(self) -> tuple[Part, ...]:
        """The logs by the kind of experiment: hanging, upright, or whole turns."""
        kinds: dict[str, list[int]] = {}
        for i, log in enumerate(self.logs):
            if np.any(self.before.log == i):
                kinds.setdefault(kind_of(log), []).append(i)
        return tuple(self._part(kind, which) for kind, which in kinds.items())

    def _part(self, name: str, which: list[int]) -> Part:
        sides = [_of_logs(side, which) for side in (self.before, self.after)]
        shared = np.minimum(sides[0].floor, sides[1].floor)
        sides = [replace(side, floor=shared) for side in sides]
        ratios = [side.ratio_to_floor for side in sides]
        closed = closed_fraction(sides[0], sides[1]) if self.changed else self.closed
        return Part(name, len(which), sides[0].rms, sides[1].rms, (ratios[0], ratios[1]), closed)

    def entry(self) -> GapEntry:
        """As the "gap" of diagnosis.json."""
        return GapEntry(
            before=_errors(self.before.rms, self.over_floor(self.before)),
            after=_errors(self.after.rms, self.over_floor(self.after)),
            noise_floor=Floors(float(self.floor[0]), float(self.floor[1])),
            closed_fraction=self.closed.value,
            closed_interval=list(self.closed.interval),
            log_likelihood_gain=self.likelier,
            held_out=self.tail is None,
            tail=self.tail,
            own_tail=self.own_tail.entry() if self.own_tail else None,
            searched_angles=list(self.searched_angles) if self.searched_angles else None,
            horizon_s=self.before.horizon,
            logs=[log.source for log in self.logs],
            by_log=[part.entry() for part in self.by_log],
            by_kind=[part.entry() for part in self.by_kind],
        )

    def to_dict(self) -> dict[str, Any]:
        """`entry` as JSON has it."""
        return written(self.entry())


def _price_of_zeros(gap: Gap) -> float:
    """What the arm's zeros cost [nats] that were estimated in these logs."""
    read = [np.sum(gap.surprise[:, 0] == i) for i, (arm, _) in gap.zeros.items() if arm != 0.0]
    return 0.5 * float(np.sum(np.log(np.maximum(read, 1.0))))


def _errors(rms: Array, over_floor: float | UnsetType = UNSET) -> Errors:
    return Errors(float(rms[0]), float(rms[1]), over_floor)


def closes(gap: GapChange | None, policy: DecisionPolicy) -> TypeGuard[GapChange]:
    """Whether some of the gap closes for certain, and a share that matters; False where there is none."""
    return gap is not None and gap.closed.interval[0] > 0.0 and gap.closed.value > policy.worth


def speaks_against(gap: GapChange, policy: DecisionPolicy) -> bool:
    """Whether held-out data speak against what was added: the gap grows for certain, or it closes for certain neither
    there nor in the likelihood. The last part of the logs has as much of the evidence as of the logs."""
    low, high = gap.closed.interval
    share = 1.0 if gap.tail is None else gap.tail
    return gap.changed and (high <= 0.0 or not (low > 0.0 or gap.likelier > share * policy.likelier))


def _of_logs(gap: Gap, which: list[int]) -> Gap:
    """A gap in the windows of some logs, over their own floor: that of all would hide what a quiet log shows."""
    kept = np.isin(gap.log, which)
    errors = gap.errors[kept]
    rms, floor = (np.sqrt(np.mean(x, axis=0)) for x in (errors**2, gap.floors[kept]))
    windows = {name: getattr(gap, name)[kept] for name in ("floors", "reading_floors", "times", "log")}
    return replace(gap, rms=rms, floor=floor, errors=errors, **windows)


def rms_interval(gap: Gap) -> Array | None:
    """95 % interval (2, 2) [rad], axis by low and high, of the rms error, by a bootstrap over `time_blocks`; None where
    they are too few."""
    group, groups = time_blocks(gap)
    if groups < FEWEST_BLOCKS:
        return None
    columns = (*(gap.errors**2).T, np.ones(len(gap.errors)))
    sums = np.stack([np.bincount(group, x, groups) for x in columns])
    picked = np.random.default_rng(_SEED).integers(0, groups, (_DRAWS, groups))
    drawn = sums[:, picked].sum(axis=2)
    return np.quantile(np.sqrt(drawn[:2] / drawn[2]), [0.025, 0.975], axis=1).T
