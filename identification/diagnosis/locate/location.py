"""Where a model fails, as a value: which row or path, when, against what, and the smoothed torque that it lacks."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from furuta_gym.declared import written

from ...discrepancy.dependence import Channel, Dependence, Variable
from ...kalman.whiteness import Innovations
from ..diagnosis_file import InnovationsEntry, MapEntry, SuspicionEntry, WhereEntry
from .constancy import Constancy
from .torque_maps import Map

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MissingTorque:
    """Smoothed torque that a stretch of a log asks for beyond the model: t (N,) [s], mean and std (N, 2) [{u}] on the
    arm's and the pendulum's row. log: its number, source: its name."""

    log: int
    source: str
    t: Array
    mean: Array
    std: Array


@dataclass(frozen=True)
class Suspicion:
    """One family of torques. gain [nats]: log-likelihood that it adds beyond other values of θ, and `net` of the price
    of its parameters; share: of what all families together add."""

    channel: Channel
    variable: Variable
    gain: float
    net: float
    share: float

    @property
    def dependence(self) -> Dependence:
        """Channel and variable."""
        return Dependence(self.channel, self.variable)


@dataclass(frozen=True)
class Where:
    """What `locate` found.

    found: whether anything is left. evidence [nats]: log-likelihood that the best family adds beyond θ, the noise
    estimated anew, less the price of its parameters. counts (2,): what it changes of q1 and q2 predicted 0.3 s ahead,
    in counts of their encoders; negligible: so little that nobody would miss it. changing: whether parameters are not
    the same all along the longest stretch; drift_counts (2,): what that changes of such predictions, in counts.
    suspicions: families, the simplest of those that are nearly as likely as the best first. channel, variable:
    of the likeliest (None if nothing is left; see also `locate.of_effects`). intervals_s: per stretch between gaps, as
    `torques`, when the torque stands out of its band. predictable (2,): cross-validated R² of the smoothed torque on
    each row; line (2,): Fisher's g and frequencies (2,) [Hz] of its periodogram.
    """

    found: bool
    sentence: str
    evidence: float
    counts: Array
    negligible: bool
    channel: Channel | None
    variable: Variable | None
    intervals_s: tuple[tuple[tuple[float, float], ...], ...]
    suspicions: tuple[Suspicion, ...]
    predictable: Array
    line: Array
    frequencies: Array
    constancy: Constancy
    drift_counts: Array
    changing: bool
    innovations: tuple[Innovations, ...] = field(repr=False)
    torques: tuple[MissingTorque, ...] = field(repr=False)
    maps: tuple[Map, ...] = field(repr=False)
    unit: str = "V"

    @property
    def matters(self) -> bool:
        """Whether something is left that somebody would miss."""
        return self.found and not self.negligible

    @property
    def structured(self) -> bool:
        """Whether what is left is more than noise: torques that go with the motion, the command or time, or parameters
        that are not the same all along."""
        return self.matters or self.changing

    def entry(self) -> WhereEntry:
        """As the "where" of diagnosis.json; intervals_s are those of the first log."""
        both = zip(self.torques, self.intervals_s, strict=True)
        first = [spans for torque, spans in both if torque.log == self.torques[0].log]
        return WhereEntry(
            channel=self.channel,
            intervals_s=[list(span) for spans in first for span in spans],
            variable=self.variable,
            map=self.sentence,
            found=self.found,
            evidence=self.evidence,
            counts=self.counts.tolist(),
            negligible=self.negligible,
            suspicions=[SuspicionEntry(**vars(s)) for s in self.suspicions[:6]],
            predictable_r2=self.predictable.tolist(),
            fisher_g=self.line.tolist(),
            frequency_hz=self.frequencies.tolist(),
            parameters_constant_p=dict(zip(self.constancy.names, self.constancy.p.tolist(), strict=True))
            | {"all": self.constancy.joint_p},
            parameters_change_counts=self.drift_counts.tolist(),
            parameters_change=self.changing,
            innovations=[InnovationsEntry(**test.to_dict()) for test in self.innovations],
            maps=[MapEntry(**m.to_dict()) for m in self.maps],
        )

    def to_dict(self) -> dict[str, Any]:
        """`entry` as JSON has it."""
        return written(self.entry())

    def __str__(self) -> str:
        rows = [self.sentence]
        for s in self.suspicions[:4] if self.found else ():
            share = f"{100 * s.share:3.0f} % of what any could"
            rows.append(f"  {s.channel:<9} against {s.variable:<24} {s.net:+8.1f} nats, {share}")
        return "\n".join(rows)
