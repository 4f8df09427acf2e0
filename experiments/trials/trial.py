"""A trial: one rig, what it hides and how large that is, and its two logs; all of it before anything is simulated."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

KINDS = ("library", "strong", "none", "torque_noise", "absorbed", "rounding", "hard", "outside", "two", "composite")
NOTHING = ("none", "torque_noise", "absorbed", "rounding")
"""Kinds of trial in which nothing is to be named."""

DURATION = 20.0
"""Length [s] of every log."""

PLAIN = "plain"
"""The kind of rig that is not of the bench: one of the plain laboratory, for rounding alone."""


@dataclass(frozen=True)
class Split:
    """A part of the world: `code` seeds the draws, `numbers` is the range of seeds, individuals and variations."""

    code: int
    numbers: tuple[int, int]
    scatter: float


SPLITS = {
    "dev": Split(code=1, numbers=(1, 1_000_000), scatter=0.08),
    "final": Split(code=8, numbers=(3_000_000, 4_000_000), scatter=0.10),
}


@dataclass(frozen=True)
class Hidden:
    """An effect to hide: at a gap ratio (the strength follows), or at a strength where the gap says nothing."""

    name: str
    form: str
    variation: int
    ratio: float | None = None
    strength: float | None = None


@dataclass(frozen=True)
class Trial:
    """One rig and its two logs. torque_noise: white torque on each row, rms over 0.1 s as a share of its Coulomb
    friction. zeros [rad]: what both encoders read where the angles are zero, in the held-out log (it follows from the
    seed, and is no part of the id). `id`: from all the rest, but tells nothing of it."""

    id: str
    kind: str
    rig: str
    hidden: tuple[Hidden, ...]
    experiment: str
    held_out: str
    seed: int
    individual: int
    scatter: float
    clock_jitter: float
    friction: str = "smooth"
    torque_noise: float = 0.0
    zeros: tuple[float, float] = field(default=(0.0, 0.0), repr=False)

    @property
    def subject(self) -> str:
        """What is asked: the hidden names, or the kind where nothing is to be named."""
        return "+".join(h.name for h in self.hidden) or self.kind

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)
