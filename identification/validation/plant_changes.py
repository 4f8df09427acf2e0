"""What differs between two plants, beyond their error bars: whether the rig has changed between two logs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from scipy.stats import chi2

from furuta_gym.plant import THETA_NAMES, Plant

from ..estimation.estimate import unit_of
from ..estimation.identifiability import spoken
from ..kalman.coordinates import SHARPNESS_NAMES
from ..normal_equations import ScaledGram
from .side_by_side import CERTAIN, ROUNDING, Difference, Estimated, difference, one_factor, one_factor_told

_BY_CHANCE = float(chi2.sf(CERTAIN**2, 1))  # so much for all parameters together


@dataclass(frozen=True)
class PlantChange:
    """What differs between two plants of a rig.

    differences: of what both estimate and their logs show. unjudged: r, what counts from the zero or the clock of a
    log, and names that one of the plants does not show or estimate. one_factor: by which all θ differ, if they do by
    one. chi2, degrees: of all differences together. only_before, only_after: effects that one of the plants has alone.
    held: what a fit held at another value than the other plant has. shared_logs: logs that both were fitted to.
    """

    differences: tuple[Difference, ...]
    unjudged: tuple[str, ...]
    one_factor: float | None
    chi2: float
    degrees: int
    only_before: tuple[str, ...] = ()
    only_after: tuple[str, ...] = ()
    held: tuple[str, ...] = ()
    shared_logs: tuple[str, ...] = ()

    @property
    def p(self) -> float:
        """How often two logs of an unchanged rig differ as much, all parameters together."""
        return float(chi2.sf(self.chi2, self.degrees)) if self.degrees else 1.0

    @property
    def certain(self) -> tuple[Difference, ...]:
        """Differences that are no chance."""
        return tuple(d for d in self.differences if d.certain)

    @property
    def changed(self) -> bool | None:
        """Whether the parameters differ for certain; None where the plants cannot be compared."""
        if self.only_before or self.only_after or self.held or self.shared_logs or not self.differences:
            return None
        return bool(self.certain) or self.one_factor is not None or self.p < _BY_CHANCE

    def to_dict(self) -> dict[str, Any]:
        """As JSON has it. null stands for what is infinite or not defined."""
        return {
            "changed": self.changed,
            "parameters": {
                d.name: {
                    "before": {"value": d.before[0], "std": d.before[1]},
                    "after": {"value": d.after[0], "std": d.after[1]},
                    "unit": d.unit,
                    "factor": d.factor,
                    "deviations": d.sure if math.isfinite(d.sure) else None,
                    "certain": d.certain,
                    "shows_from_percent": d.shows_from,
                }
                for d in self.differences
            },
            "not_judged": list(self.unjudged),
            "one_factor": self.one_factor,
            "chi2": self.chi2,
            "degrees_of_freedom": self.degrees,
            "p": self.p,
            "effects": {"only_before": list(self.only_before), "only_after": list(self.only_after)},
            "held_differently": list(self.held),
            "shared_logs": list(self.shared_logs),
        }

    def __str__(self) -> str:
        lines = []
        if self.only_before or self.only_after:
            each = ((self.only_before, "first"), (self.only_after, "second"))
            said = " and ".join(f"only the {which} has {', '.join(names)}" for names, which in each if names)
            lines.append(
                f"These plants cannot be compared: {said}, and an effect changes every θ. Fit both logs with the same "
                "effects: furuta identify LOG --effects NAMES"
            )
        if self.held:
            lines.append(
                f"These plants cannot be compared: they have other values of {spoken(self.held)}, which a fit held, "
                "and every other parameter depends on that. Fit both with the same values"
            )
        if self.shared_logs:
            lines.append(
                f"These plants cannot be compared: both were fitted to {', '.join(self.shared_logs)}. Fit each to logs "
                "of its own"
            )
        if lines:
            return "\n".join(f"{line}." for line in lines)
        if self.one_factor is not None:
            lines.append(one_factor_told("those of the first", self.one_factor))
        if certain := [d for d in self.certain if self.one_factor is None or d.name not in THETA_NAMES]:
            lines.append(f"Differs by more than {CERTAIN:g} standard deviations: {', '.join(map(str, certain))}")
        odds = f"chi² {self.chi2:.3g} with {self.degrees} degrees of freedom, p = {self.p:.2g}"
        if not self.differences:
            lines.append("No parameter shows in both")
        elif not lines and self.p < _BY_CHANCE:
            lines.append(f"No single parameter differs for certain, but all together do: {odds}")
        elif not lines:
            blind = [name for name in THETA_NAMES if name in self.unjudged]
            seen = f" in {spoken(d.name for d in self.differences)}" if blind else ""
            lines.append(f"No change shows{seen}: no parameter differs by {CERTAIN:g} standard deviations; {odds}")
            if blind:
                lines.append(f"Of {spoken(blind)} these logs say nothing: a change of them would not show")
        return "\n".join(f"{line}." for line in lines)


def plant_change(before: Plant, after: Plant) -> PlantChange:
    """What differs between two plants whose logs are others. Their errors are taken as independent.

    Raises ValueError where a plant has no error bars, or the commands have different units.
    """
    if before.unit != after.unit:
        raise ValueError(f"one command is in {before.unit}, the other in {after.unit}; expected one unit for both")
    a, b = Estimated.of_plant(before), Estimated.of_plant(after)
    shared = [name for name in a.names if name in b.names and name not in a.lost | b.lost]
    (x, of_x), (y, of_y) = a.of(shared), b.of(shared)
    gained = ScaledGram.of(of_x + of_y).gain(y - x, ROUNDING) if shared else None
    names = [{e.name for e in plant.effects} for plant in (before, after)]
    return PlantChange(
        tuple(difference(a, b, name, unit_of(name, before)) for name in shared),
        tuple(name for name in dict.fromkeys((*a.names, *b.names)) if name not in shared),
        one_factor(a, [b]),
        2.0 * gained.gain if gained else 0.0,
        gained.rank if gained else 0,
        tuple(sorted(names[0] - names[1])),
        tuple(sorted(names[1] - names[0])),
        _held(before, after, a, b),
        _shared_logs(before, after),
    )


def _held(before: Plant, after: Plant, a: Estimated, b: Estimated) -> tuple[str, ...]:
    """Parameters of both plants that one fit at least did not move, and that differ: where the other one estimated
    them, by more than chance. r is left out, as it is everywhere."""
    p, q = before.packed().p, after.packed().p
    both = [n for n in before.layout.names if n in after.layout.names and n not in SHARPNESS_NAMES]
    found = []
    for name in both:
        errors = [e.std(name) for e in (a, b) if name in e.names]
        x, y = p[before.layout.row(name)], q[after.layout.row(name)]
        if len(errors) < 2 and abs(y - x) > max(CERTAIN * sum(errors), 1e-9 * max(abs(x), abs(y))):
            found.append(name)
    return tuple(found)


def _shared_logs(before: Plant, after: Plant) -> tuple[str, ...]:
    """Logs of which both plants were fitted to the same samples."""
    entries = [plant.provenance.get("logs") or [] for plant in (before, after)]
    return tuple(
        str(a.get("source"))
        for a in entries[0]
        if a.get("sha256") and any(a["sha256"] == b.get("sha256") and _overlap(a, b) for b in entries[1])
    )


def _overlap(a: Mapping[str, Any], b: Mapping[str, Any]) -> bool:
    """Whether two parts of a log, as the provenance has them, have any time in common."""
    return any(max(x[0], y[0]) < min(x[1], y[1]) for x in _spans(a) for y in _spans(b))


def _spans(entry: Mapping[str, Any]) -> list[tuple[float, float]]:
    """What was fitted of a log, in seconds of its clock."""
    if entry.get("stretches_s"):
        return [(low, high) for low, high in entry["stretches_s"]]
    cuts, spans = sorted(entry.get("cut_s") or []), []
    start = first = float(entry.get("skipped_s") or 0.0)
    for low, high in cuts:
        spans.append((start, low))
        start = max(start, high)
        first = start if low <= first else first  # nothing is left before it
    end = first + float(entry.get("duration_s") or math.inf)
    return [(low, min(high, end)) for low, high in (*spans, (start, end)) if low < min(high, end)]
