"""Every threshold of the proposal in one value, each with its reason."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from ..checks import MAX_SPEED
from ..signs import TRUSTED_R2


def _rule(default: Any, why: str) -> Any:
    return field(default=default, metadata={"why": why})


@dataclass(frozen=True)
class ProposalPolicy:
    """The thresholds of `propose`, each with its reason as metadata."""

    samples: int = _rule(20_000, "samples that are looked at, the liveliest of the log: enough for every sign")
    shortest_step: float = _rule(5e-5, "s between samples; no rig's computer is faster")
    longest_step: float = _rule(0.25, "s between samples; slower is no log of a swinging pendulum")
    shortest_log: float = _rule(0.3, "s; shorter is no log, or its clock is in another unit")
    longest_log: float = _rule(1e6, "s, some days")
    r2: float = _rule(TRUSTED_R2, "of the pendulum's acceleration explained, from which its row is believed")
    gravity: tuple[float, float] = _rule((12.0, 900.0), "1/s², of gravity over inertia: pendulums of 1.2 m … 2 cm")
    coupling: tuple[float, float] = _rule((0.1, 10.0), "of arm to pendulum, θ3/θ4: about arm length over pendulum's")
    clearly: float = _rule(0.5, "of the unexplained part of another reading, up to which one is clearly better")
    swapped: float = _rule(0.34, "the same for other columns than those that the names say")
    finest: float = _rule(2.2e-4, "rad an encoder's step: 28 600 counts, more are not built into such rigs")
    coarsest: float = _rule(0.02, "rad an encoder's step: 314 counts, fewer are not either")
    fastest: float = _rule(MAX_SPEED, "rad/s; a pendulum of 5 cm that falls from upright reaches about 30")
    too_still: float = _rule(3.0, "degrees of both angles; a log that moves less tells nothing, so it is in rad")
    zero: float = _rule(25.0, "degrees from upright or hanging, beyond which a zero is neither")
    same_rig: float = _rule(1.6, "ratio of gravity or coupling between logs, beyond which they are of two rigs")
    sure_of_rig: float = _rule(0.97, "of the pendulum's acceleration explained, to compare two logs' rigs by")
    same_gain: float = _rule(1.2, "factor between what the command does in two logs, beyond which it may be told")
    sure_of_gain: float = _rule(2.0, "of what is left with that factor, which is left without: at most 1.7 on one rig")
    large_command: float = _rule(3.0, "of a command; motors of such rigs do not reach as many N·m")
