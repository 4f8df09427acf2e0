"""A torque that was learned because no name explains it, and what became of it, as a value."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from furuta_gym.declared import written
from furuta_gym.plant import Effect, Plant

from .diagnosis_file import EffectInPlant, LearnedEntry
from .gap_change import GapChange


@dataclass(frozen=True)
class Learned:
    """What was learned and what became of it.

    plant: the plant with `arm_learned`, whether it was added or not. evidence [nats]: for the surface. change: of the
    gap on data that no fit saw, None where none could be had. added: whether it is in the plant that the diagnosis
    gives; `reason` says why, in a sentence without a full stop.
    """

    plant: Plant
    evidence: float
    change: GapChange | None = field(repr=False)
    added: bool
    reason: str

    @property
    def effect(self) -> Effect | None:
        """What was learned, as `plant` carries it."""
        return next((effect for effect in self.plant.effects if effect.type.learned), None)

    def entry(self) -> LearnedEntry:
        """As the "learned" of diagnosis.json."""
        return LearnedEntry(
            effect=EffectInPlant.of(self.effect.to_dict(self.plant.unit)) if self.effect else None,
            evidence=self.evidence,
            gap=self.change.entry() if self.change else None,
            added=self.added,
            reason=self.reason,
        )

    def to_dict(self) -> dict[str, Any]:
        """`entry` as JSON has it."""
        return written(self.entry())
