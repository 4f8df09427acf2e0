"""Logs under a plant that may be corrected freely: what every question about what is left starts from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from furuta_gym.plant import Plant

from ...discrepancy.basis import Family, Knots, Signals, families
from ...discrepancy.correction import flexible
from ...estimation.pool import mapped, one_blas_thread, shared_pool
from ...kalman.path import along, smooth
from ...kalman.record import Stretch, stretches
from ...kalman.taken import FEWEST
from ...logs.checks import LogError
from ...logs.log import Log
from ..policy import DecisionPolicy
from .evidence import Look, evidence_of
from .laws import own_families, ways


@dataclass(frozen=True)
class Seen:
    """Logs under a plant with free corrections: what `locate` decides on, and evidence for more than the best family.

    columns: the families along each of `looks`.
    """

    plant: Plant
    logs: tuple[Log, ...]
    looks: tuple[Look, ...]
    columns: tuple[list[Family], ...]

    @classmethod
    @one_blas_thread
    def of(cls, plant: Plant, logs: Sequence[Log], policy: DecisionPolicy) -> Seen:
        """Raises as `locate`."""
        pool = shared_pool()
        looks = tuple(mapped(pool, lambda s: _look(plant, s, logs[s.log].origin), long_enough(logs, policy)))
        knots = Knots.of([look.signals for look in looks])
        peaks = max(looks, key=lambda look: look.flexible.path.record.duration).flexible.peaks
        columns = mapped(pool, lambda look: families(look.signals, plant, knots, peaks, logs[look.log].span), looks)
        return cls(plant, tuple(logs), looks, tuple(columns))

    @one_blas_thread
    def another_law(self, name: str) -> float:
        """Evidence [nats] that the law of the plant's effect `name` is another: that a further function of what the
        effect depends on makes the logs likelier."""
        own = [own_families(name, self.plant, look.signals, self.logs[look.log].span) for look in self.looks]
        columns = [[*known, *further] for known, further in zip(self.columns, own, strict=True)]
        return max(evidence_of(self.looks, columns, chosen).nats for chosen in ways(name, own[0]))


def long_enough(logs: Sequence[Log], policy: DecisionPolicy) -> list[Stretch]:
    """The stretches between gaps in which `locate` looks. Raises LogError if there is none."""
    found = [s for s in stretches(logs) if s.record.duration >= policy.shortest and len(s.piece) >= FEWEST]
    if not found:
        raise LogError(
            f"{', '.join(log.source for log in logs)}: no stretch of {policy.shortest:g} s without a gap of the clock. "
            "Expected one at least, to say what a model misses; record without dropping samples, or more slowly."
        )
    return found


def _look(plant: Plant, stretch: Stretch, start: float) -> Look:
    try:
        found = flexible(plant, stretch.record)
    except ValueError as error:
        raise ValueError(f"{stretch.piece.source}: {error}") from error
    smoothed = smooth(found.plain.path)
    plain = along(found.plain.path, smoothed.mean, smoothed.variance[:, 2:4]) or found.uncorrected
    return Look(stretch.log, start, found, plain, Signals.of(found.uncorrected))
