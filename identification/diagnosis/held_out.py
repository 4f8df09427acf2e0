"""Data that no fit saw: logs that were held out or, where there are none, the last part of each fitted one.

A plant predicts whole logs as it is. The last part of a log is predicted by the same structure fitted to the rest.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from furuta_gym.plant import Plant

from ..estimation.estimate import Estimate
from ..estimation.identify import identify
from ..estimation.pool import mapped, shared_pool
from ..estimation.zeros import moved
from ..kalman.coordinates import Zeros, placed
from ..kalman.noise import LostLog
from ..kalman.noise_model import Noise
from ..logs.checks import LogWarning
from ..logs.log import Log
from ..validation.closed_fraction import ClosedFraction, closed_fraction
from ..validation.gap import Gap, fit_percent, over_floor, validate
from .gap_change import GapChange, closes, speaks_against
from .naming.fits import Fit, added, further
from .policy import DecisionPolicy
from .within_reach import arm_angles, share_beyond

Array = NDArray[np.float64]
_Asked = tuple[Plant, Noise | None, Zeros | None, float]
"""What `HeldOut.gap` takes of a fit."""


@dataclass(frozen=True)
class HeldOut:
    """A witness for what a search finds in `logs`: how well plants predict what no fit saw. Gaps are kept, as the same
    plants are asked for again."""

    logs: tuple[Log, ...]
    whole: tuple[Log, ...]
    policy: DecisionPolicy
    _known: dict[int, tuple[Plant, Gap | ValueError]] = field(default_factory=dict, repr=False)
    _freed: dict[int, tuple[Plant, Estimate]] = field(default_factory=dict, repr=False)
    _joint: dict[int, tuple[Plant, tuple[Estimate, float] | None]] = field(default_factory=dict, repr=False)

    @property
    def same_clock(self) -> bool:
        """Whether they are a later part of the searched logs."""
        return not self.whole

    def gap(
        self, plant: Plant, noise: Noise | None = None, zeros: Zeros | None = None, strain: float = math.inf
    ) -> Gap:
        """The gap of a plant that was fitted to the logs with this noise and these zeros: of a fit of the search, which
        is fitted once more without the prior where it predicts poorly. strain [nats]: what that promises the fit.

        Without a noise, a refit to the first part of the logs finds its own. Raises ValueError where the logs are too
        short, or their first part alone cannot be fitted.
        """
        known = self._known.get(id(plant))
        if known is None:
            known = self._known[id(plant)] = plant, self._tried(plant, noise, zeros, strain)
        if isinstance(known[1], ValueError):
            raise known[1]
        return known[1]

    def follows(self, plant: Plant) -> bool:
        """Whether the gap of a plant that was fitted to the logs can be had."""
        try:
            self.gap(plant)
        except ValueError:
            return False
        return True

    def gaps(self, *asked: _Asked) -> list[Gap]:
        """`gap` of several plants, at once."""
        fresh = [plant for plant, *_ in asked if id(plant) not in self._known]
        pool = shared_pool() if len(fresh) > 1 else None  # a single one uses the threads by itself
        return list(mapped(pool, lambda one: self.gap(*one), asked))

    def _tried(self, plant: Plant, noise: Noise | None, zeros: Zeros | None, strain: float) -> Gap | ValueError:
        try:
            return self._measured(plant, noise, zeros, strain)
        except ValueError as error:  # kept as well: to find that out again may take a fit
            return error

    def _measured(self, plant: Plant, noise: Noise | None, zeros: Zeros | None, strain: float) -> Gap:
        if self.whole:
            return self._of_whole(plant, noise, zeros, strain)
        tail = self.policy.tail
        heads = [log.slice(stop=_cut(log, tail)) for log in self.logs]
        refitted = self._refitted(heads, plant, noise, zeros)
        if unseen := _unseen(refitted):
            raise ValueError(
                f"the first {100 * (1.0 - tail):.0f} % of the logs do not show {', '.join(unseen)}, so nothing is held "
                "out that could check it; give a log to be held out"
            )
        return _of_tails(refitted.plant, moved(self.logs, refitted.zeros), tail)

    def _of_whole(self, plant: Plant, noise: Noise | None, zeros: Zeros | None, strain: float) -> Gap:
        """The gap on whole logs. The search's prior holds θ near model (5), which may spoil a right name's predictions,
        or make the plant lose them: then the fit without it counts, where that is nearer. A fit that the prior costs
        next to nothing is the same without it."""
        try:
            gap = validate(plant, self.whole)
        except LostLog:
            if noise is None:
                raise
            return validate(self._free(plant, noise, zeros).plant, self.whole)
        if noise is None or strain <= self.policy.strained or gap.ratio_to_floor <= self.policy.adequate:
            return gap
        with suppress(ValueError):
            free = validate(self._free(plant, noise, zeros).plant, self.whole)
            floor = np.minimum(gap.floor, free.floor)  # a wrong plant has a higher one of its own
            return min(gap, free, key=lambda one: over_floor(one.rms, floor))
        return gap

    def _free(self, plant: Plant, noise: Noise | None, zeros: Zeros | None) -> Estimate:
        """A fit of the search without its prior."""
        if id(plant) not in self._freed:
            self._freed[id(plant)] = plant, self._refitted(self.logs, plant, noise, zeros)
        return self._freed[id(plant)][1]

    @staticmethod
    def _refitted(logs: Sequence[Log], plant: Plant, noise: Noise | None, zeros: Zeros | None) -> Estimate:
        """The plant with its parameters fitted to some logs, without a prior."""
        start = plant.without_fit()
        # from the noise that the search ended with: from more of it, a fit loses what is small against it again
        return identify(logs, start, noise=noise, zeros=zeros if noise else None, polished=False, model_error=False)

    def jointly(self, plant: Plant) -> tuple[Estimate, float] | None:
        """A plant with its parameters fitted to the logs held out as well, and its error over the noise floor on those.
        None where there are none, or where no such fit can be had."""
        if not self.whole:
            return None
        if id(plant) not in self._joint:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", LogWarning)  # that their zeros lie apart, which is allowed for
                try:
                    fitted = identify((*self.logs, *self.whole), plant, polished=False, model_error=False)
                    self._joint[id(plant)] = plant, (fitted, validate(fitted.plant, self.whole).ratio_to_floor)
                except ValueError:
                    self._joint[id(plant)] = plant, None
        return self._joint[id(plant)][1]

    def together(self, plant: Plant) -> float | None:
        """The error of `jointly`."""
        found = self.jointly(plant)
        return None if found is None else found[1]

    def searched_angles(self, gap: Gap, plants: Sequence[Plant], zeros: Zeros) -> tuple[float, float] | None:
        """The arm's angles [rad] in the searched logs, whose zeros are given, from and to, if some of the plants depend
        on its angle and it leaves them in the logs held out; else None. `gap` has the zeros of these."""
        if not self.whole or not any(placed(plant) for plant in plants):
            return None
        searched = arm_angles(self.logs, zeros)
        low, high = float(searched.min()), float(searched.max())
        beyond = share_beyond(arm_angles(self.whole, gap.zeros), low, high)
        return (low, high) if beyond > self.policy.beyond else None

    def change(self, before: Gap, after: Gap) -> GapChange:
        """How much of the gap closes from one plant to another; nothing from one to itself."""
        closed = closed_fraction(before, after) if after is not before else ClosedFraction(0.0, (0.0, 0.0))
        return GapChange(before, after, closed, self.whole or self.logs, None if self.whole else self.policy.tail)

    def hears(self, fits: Sequence[Fit]) -> None:
        """Measures the gaps of several fits at once; those that cannot be had are none when they are asked for."""
        fresh = {id(fitted.plant): fitted for fitted in fits if id(fitted.plant) not in self._known}
        pool = shared_pool() if len(fresh) > 1 else None  # a single one uses the threads by itself
        list(mapped(pool, self._heard, fresh.values()))  # each once: two threads would measure the same

    def _heard(self, fitted: Fit) -> None:
        with suppress(ValueError):
            self.gap(*_asked(fitted))

    def far(self, fitted: Fit) -> bool:
        """Whether a fit predicts much worse than noise would (`policy.far`), or its filter loses the data. As for every
        `Witness`, False where nobody can tell."""
        return self._beyond(fitted, self.policy.far)

    def off(self, fitted: Fit) -> bool:
        """Whether a fit predicts worse than an adequate plant (`policy.adequate`), or its filter loses the data."""
        return self._beyond(fitted, self.policy.adequate)

    def _beyond(self, fitted: Fit, ratio: float) -> bool:
        try:
            return self.gap(*_asked(fitted)).ratio_to_floor > ratio
        except ValueError as error:
            return isinstance(error, LostLog)

    def confirms(self, without: Fit, fitted: Fit) -> bool:
        """Whether further effects close some of the gap for certain, and a share of it that matters. Of what follows
        the clock of its own log, other logs say nothing."""
        if self.whole and all(effect.type.follows_clock for effect in further(fitted, without)):
            return False
        change = self._between(without, fitted)
        if change is None:
            return self._loses(without) and not self._loses(fitted)
        return closes(change, self.policy) and change.likelier > self.policy.likelier

    def prefers(self, fitted: Fit, other: Fit) -> bool:
        """Whether they ask for another fit in the place of one, by more than the fitted logs speak against it: then all
        data together are likelier. The last part of a fitted log is no further data. Between equals on the fitted logs
        the error on other logs decides alone."""
        loss = other.value - fitted.value
        if self.whole and loss < self.policy.equal and closes(self._between(fitted, other), self.policy):
            return True
        if not self.confirms(fitted, other):
            return False
        change = self._between(fitted, other) if self.whole else None
        return loss < self.policy.likelier or (change is not None and change.likelier > loss)

    def denies(self, without: Fit, fitted: Fit) -> bool:
        """Whether they speak against one effect beside others, or only the plant with it loses them. Of what follows
        the clock of its own log, other logs say nothing; if it repeats, the last parts of the searched logs do."""
        kind = added(fitted, without).type
        if self.whole and kind.follows_clock:
            return kind.repeats and self._own_tails.denies(without, fitted)
        change = self._between(without, fitted)
        if change is None:
            return self._loses(fitted) and not self._loses(without)
        return speaks_against(change, self.policy)

    def excuses(self, without: Fit, fitted: Fit) -> bool:
        """Whether it says nothing if they speak against an effect: something depends on the arm's angle, the arm is
        elsewhere than in the fitted logs, and one plant with the effect explains all logs.

        What is there explains more of all logs than of the fitted ones. What only imitates something on these, at
        other angles explains less."""
        if added(fitted, without).type.follows_clock:
            return False
        change, plants = self._between(without, fitted), (without.plant, fitted.plant)
        if change is None:  # one of them loses the logs, and with it the arm's place in them
            elsewhere = bool(self.whole) and any(placed(plant) for plant in plants)
        else:
            elsewhere = self.searched_angles(change.after, plants, fitted.zeros) is not None
        if not elsewhere:
            return False
        found = self.jointly(fitted.plant)
        if found is None or found[1] > self.policy.far:
            return False
        bare = self.jointly(without.plant)
        if bare is None:
            return True
        try:  # neither fit of all logs has the search's prior
            one, other = (self._free(f.plant, f.noise, f.zeros) for f in (fitted, without))
            gained = one.log_likelihood - other.log_likelihood
        except ValueError:
            gained = without.value - fitted.value
        return bool(found[0].log_likelihood - bare[0].log_likelihood > gained)

    @cached_property
    def _own_tails(self) -> HeldOut:
        """The last parts of the searched logs, as data that are held out."""
        return HeldOut(self.logs, (), self.policy)

    def _loses(self, fitted: Fit) -> bool:
        """Whether the filter of a fit's plant cannot follow them."""
        try:
            self.gap(*_asked(fitted))
        except LostLog:
            return True
        except ValueError:
            return False
        return False

    def _between(self, without: Fit, fitted: Fit) -> GapChange | None:
        try:
            before, after = self.gaps(*map(_asked, (without, fitted)))
        except ValueError:
            return None
        return self.change(before, after)


def _asked(fitted: Fit) -> _Asked:
    return fitted.plant, fitted.noise, fitted.zeros, fitted.strain


def _unseen(fitted: Estimate) -> list[str]:
    """Effects of which the fitted data determine no size. Their parameters are those of the start."""
    unknown = set(fitted.identifiability.unidentified)
    return [
        effect.name
        for effect in fitted.plant.effects
        if {f"{effect.name}.{p.name}" for p in effect.type.parameters if p.role == "size"} <= unknown
    ]


def _cut(log: Log, tail: float) -> float:
    """Where the last part of the samples begins [s]; by time, a long gap would leave too much or nothing."""
    return float(np.interp((1.0 - tail) * (len(log) - 1), np.arange(len(log)), log.t))


def _of_tails(plant: Plant, logs: Sequence[Log], tail: float) -> Gap:
    """The gap in the windows that lie in the last part of each log, over their own floor. The filter runs from the
    start, so that what changes with time is predicted at its time."""
    gap = validate(plant, logs, own_zeros=False)
    cut = np.array([_cut(log, tail) for log in logs])
    late = gap.times - gap.horizon >= cut[gap.log]
    if late.sum() < 10:
        raise ValueError(f"the last {100 * tail:.0f} % of the logs are too short for prediction over {gap.horizon:g} s")
    errors = gap.errors[late]
    rms, floor, only = (np.sqrt(np.mean(x, axis=0)) for x in (errors**2, gap.floors[late], gap.reading_floors[late]))
    reading = np.concatenate([readings_at(logs[i], gap.times[late & (gap.log == i)]) for i in range(len(logs))])
    return replace(
        gap,
        rms=rms,
        floor=floor,
        reading_floor=np.minimum(only, floor),
        fit_percent=fit_percent(rms, reading, np.sort(gap.log[late])),
        curve=np.concatenate([[gap.horizon], rms, floor])[None],
        errors=errors,
        floors=gap.floors[late],
        reading_floors=gap.reading_floors[late],
        times=gap.times[late],
        log=gap.log[late],
        still=gap.still[late],
        resting=gap.still[late].mean(axis=0),
        surprise=gap.surprise[gap.surprise[:, 1] >= cut[gap.surprise[:, 0].astype(int)]],
    )


def readings_at(log: Log, times: Array) -> Array:
    """Readings (M, 2) of a log at some of its own stamps (M,)."""
    return log.angles[np.clip(np.searchsorted(log.t, times - 1e-9), 0, len(log) - 1)]
