"""How plain each effect is on each kind of rig: one measured point (strength, gap ratio) per experiment.

The gap grows about in proportion to the strength, so a point is enough to guess the strength for a wanted ratio; `seal`
measures what the guess is worth on the rig itself. A point that is null was not measured, or the pendulum fell at every
strength; the guess is then strength 1. `python -m experiments.trials.sizes` measures all points again.
"""

from __future__ import annotations

import json
import math
from functools import cache
from importlib.resources import files

from rich.progress import track

from experiments.bench import SETS, HiddenEffect, PendulumLost, Rig, catalogue, effect_size

COUNTS = 4096
"""Encoder counts per turn of every rig of the trials."""

LARGEST = 4.0
"""Strength up to which an effect is of the usual size."""

STRONGEST = 30.0
"""The same of trials with a strong effect."""

EXPERIMENTS = {
    **dict.fromkeys(
        (
            "arm_spring", "arm_cable", "arm_taut_cable", "arm_hysteresis", "arm_ripple", "arm_position_friction",
            "base_tilt", "arm_encoder_eccentricity", "pendulum_encoder_offset", "input_offset", "arm_coulomb_asymmetry",
        ),
        ("paper", "wide"),
    ),
    **dict.fromkeys(
        (
            "pendulum_quadratic_drag", "pendulum_stribeck", "pendulum_coulomb_asymmetry",
            "pendulum_encoder_eccentricity", "lost_counts",
        ),
        ("paper", "hanging-chirp"),
    ),
}  # fmt: skip
"""The experiments that are tried for an effect, where that is more than the paper's."""

_FILE = files("experiments.trials") / "sizes.json"
_STRENGTHS = (1.0, 0.3, 4.0)
_PLAIN = 1.05


@cache
def _table() -> dict[str, dict[str, dict[str, list[float] | None]]]:
    return json.loads(_FILE.read_text(encoding="utf-8"))


def first_guess(effect: str, kind: str, experiment: str, ratio: float, largest: float = LARGEST) -> float:
    """Strength at which `effect` has about this gap ratio on a rig of this kind, at most `largest`.

    1 where the table has no point.
    """
    strength, seen = _table().get(effect, {}).get(experiment, {}).get(kind) or (1.0, 1.0)
    return min(largest, scaled(strength, seen, ratio))


def gaps(effect: str, kind: str) -> dict[str, float]:
    """For each experiment tried: the gap at strength 1, √(ratio² − 1), by proportion."""
    points = {experiment: rigs[kind] for experiment, rigs in _table()[effect].items()}
    return {name: math.sqrt(p[1] ** 2 - 1.0) / p[0] if p else 0.0 for name, p in points.items()}


def reach(effect: str, kind: str, experiment: str, largest: float = LARGEST) -> float:
    """Largest gap ratio to ask for: that of strength `largest`, by proportion; infinite where no point was measured."""
    gap = gaps(effect, kind).get(experiment, 0.0)
    return math.sqrt(1.0 + (largest * gap) ** 2) if gap else math.inf


def scaled(strength: float, seen: float, wanted: float) -> float:
    """The strength for the ratio `wanted` if `strength` showed the ratio `seen`: the gap in proportion.

    A ratio of 1 (no gap) gives four times the strength.
    """
    factor = math.sqrt((wanted**2 - 1.0) / max(seen**2 - 1.0, 1e-9))
    return strength * min(max(factor, 0.01), 4.0 if seen < 1.001 else 100.0)


def measure(effect: str, kind: str, experiment: str) -> tuple[float, float] | None:
    """(strength, ratio) of a gap that shows: at strength 1, smaller if the pendulum falls, larger if nothing shows.

    None if the pendulum falls at all of them.
    """
    point = None
    for strength in _STRENGTHS:
        try:
            seen = effect_size(Rig(kind, [HiddenEffect(effect, strength)], encoder_counts=COUNTS), experiment).ratio
        except PendulumLost:
            continue
        if point is None or seen > point[1]:
            point = (strength, round(seen, 4))
        if seen > _PLAIN and strength <= 1.0:
            break
    return point


def main() -> None:
    """Measure every point and write sizes.json beside this module."""
    wanted = [
        (name, experiment, kind)
        for name, effect in catalogue().items()
        if effect.kind in ("library", "outside")
        for experiment in EXPERIMENTS.get(name, ("paper",))
        for kind in SETS
    ]
    table: dict[str, dict[str, dict[str, tuple[float, float] | None]]] = {}
    for name, experiment, kind in track(wanted, description="measuring"):
        table.setdefault(name, {}).setdefault(experiment, {})[kind] = measure(name, kind, experiment)
    with open(str(_FILE), "w", encoding="utf-8") as file:
        json.dump(table, file, indent=1)


if __name__ == "__main__":
    main()
