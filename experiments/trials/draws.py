"""What a trial hides, drawn: every trial from a generator of its own, seeded by its split and its place in the plan."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np

from experiments.bench import SETS

from . import sizes
from .trial import PLAIN, Hidden, Split, Trial

RATIOS = (1.1, 10.0)
RATIOS_STRONG = (10.0, 300.0)
RATIOS_OUTSIDE = (1.5, 10.0)
RATIOS_TWO = (1.3, 5.0)
RATIOS_COMPOSITE = (1.5, 20.0)
RATIOS_POWER = (1.005, 3.0)

COMPOSITE = ("arm_cable", "arm_hysteresis", "input_delay", "input_dead_zone", "base_tilt")
"""What a composite rig hides three to five of, as a QUBE on a desk has them."""

_ZEROS = 0.5, 2.0 * math.pi / sizes.COUNTS  # rad: how far the zeros of two logs are apart at most

TWINS = (
    {"input_delay", "actuator_lag"},
    {"input_offset", "arm_coulomb_asymmetry"},
    {"arm_friction_drift", "arm_viscous_drift"},
    {"base_tilt", "pendulum_encoder_offset"},
    {"arm_presliding", "arm_backlash"},
    {"arm_presliding", "friction_sharpness"},
    {"arm_presliding", "arm_hysteresis"},
    {"arm_spring", "arm_cable"},
    {"arm_spring", "arm_taut_cable"},
    {"arm_cable", "arm_taut_cable"},
)
"""Pairs of effects that are equal to first order or exclude each other: not hidden together."""

ONE_TORQUE = ({"input_offset", "arm_spring"}, {"input_offset", "arm_cable"}, {"input_offset", "arm_taut_cable"})
"""Pairs that no log can tell apart, as a constant torque only moves the angle to which the other draws the arm: drawn
again, so that all other trials stay what they were."""

_NO_HARD_FRICTION = {"arm_presliding", "friction_sharpness"}  # they replace the friction that would be hard


def experiment_for(effect: str, rig: str) -> str:
    """The paper's experiment, or the one whose gap is more than twice as large at equal strength."""
    gaps = sizes.gaps(effect, rig)
    best = max(gaps, key=lambda name: gaps[name])
    return best if gaps[best] > 2.0 * gaps["paper"] else "paper"


def allowed_pairs(effects: Iterable[str]) -> list[tuple[str, str]]:
    """The pairs of effects that can be told apart and are seen in one kind of experiment."""
    pairs = combinations(effects, 2)
    return [(a, b) for a, b in pairs if {a, b} not in TWINS and _hanging(a) == _hanging(b)]


def _hanging(effect: str) -> bool:
    return any(experiment_for(effect, rig) == "hanging-chirp" for rig in SETS)


_HELD_OUT = {
    "paper": "steps",
    "wide": "paper",
    "hanging-chirp": "free-decay",
    "hanging": "upright",
    "upright": "hanging",
}


def _zeros(rng: np.random.Generator) -> tuple[float, float]:
    return float(rng.uniform(-_ZEROS[0], _ZEROS[0])), float(rng.uniform(-_ZEROS[1], _ZEROS[1]))


class Maker:
    """Draws trials of one split."""

    def __init__(self, split: Split, prefix: str):
        self._split, self._prefix = split, prefix

    def _rng(self, *name: object) -> np.random.Generator:
        return np.random.default_rng([self._split.code, *(self._prefix + "/".join(map(str, name))).encode()])

    def _number(self, rng: np.random.Generator) -> int:
        return int(rng.integers(*self._split.numbers))

    def _trial(self, rng: np.random.Generator, kind: str, rig: str, experiment: str, **more: Any) -> Trial:
        other = bool(rng.integers(2))  # half are held out by another seed, half by another experiment too
        trial = Trial(
            id="",
            kind=kind,
            rig=rig,
            experiment=experiment,
            held_out=_HELD_OUT[experiment] if other else experiment,
            seed=self._number(rng),
            individual=self._number(rng),
            scatter=self._split.scatter,
            clock_jitter=float(rng.choice([0.0, 0.0, 0.03])),
            **more,
        )
        return replace(trial, id=hashlib.blake2b(repr(trial).encode(), digest_size=6).hexdigest())

    def _hidden(self, rng: np.random.Generator, name: str, rig: str, form: str, ratios: tuple[float, float]) -> Hidden:
        low, high = ratios
        high = max(low, min(high, sizes.reach(name, rig, experiment_for(name, rig))))
        ratio = math.exp(rng.uniform(math.log(low), math.log(high)))
        return Hidden(name, form, self._number(rng), ratio=ratio)

    def library(self, name: str, rig: str, k: int, power: bool) -> Trial:
        rng = self._rng("library", name, rig, k)
        form = str(rng.choice(["table", "bench"]))
        if power:  # log-uniform in what is visible: ratio − 1
            low, high = RATIOS_POWER
            ratio = 1.0 + math.exp(rng.uniform(math.log(low - 1.0), math.log(high - 1.0)))
            hidden = Hidden(name, form, self._number(rng), ratio=ratio)
        else:
            hidden = self._hidden(rng, name, rig, form, RATIOS)
        hard = form == "bench" and name not in _NO_HARD_FRICTION and rng.uniform() < 0.25
        friction = "hard" if hard else "smooth"
        return self._trial(rng, "library", rig, experiment_for(name, rig), hidden=(hidden,), friction=friction)

    def strong(self, name: str, rig: str, k: int) -> Trial | None:
        """An effect far larger than any log can hide, and logs that count from different zeros; None where it
        cannot be so large on this kind of rig."""
        rng = self._rng("strong", name, rig, k)
        experiment = experiment_for(name, rig)
        highest = min(RATIOS_STRONG[1], sizes.reach(name, rig, experiment, sizes.STRONGEST))
        if highest < 1.2 * RATIOS_STRONG[0]:
            return None
        ratio = math.exp(rng.uniform(math.log(RATIOS_STRONG[0]), math.log(highest)))
        hidden = Hidden(name, str(rng.choice(["table", "bench"])), self._number(rng), ratio=ratio)
        return self._trial(rng, "strong", rig, experiment, hidden=(hidden,), zeros=_zeros(rng))

    def composite(self, rig: str, k: int) -> Trial:
        """Three to five effects at once, and logs that count from different zeros."""
        rng = self._rng("composite", rig, k)
        names = sorted(rng.choice(COMPOSITE, size=int(rng.integers(3, 6)), replace=False).tolist())
        forms = [str(rng.choice(["table", "bench"])) for _ in names]
        hidden = tuple(self._hidden(rng, n, rig, f, RATIOS_COMPOSITE) for n, f in zip(names, forms, strict=True))
        found = [experiment_for(name, rig) for name in names]
        experiment = next((e for e in found if e != "paper"), "paper")
        return self._trial(rng, "composite", rig, experiment, hidden=hidden, zeros=_zeros(rng))

    def rounding(self, k: int) -> Trial:
        """A rig of the plain laboratory: nothing but rounding."""
        rng = self._rng("rounding", k)
        experiment = ("hanging", "upright")[k % 2]
        return self._trial(rng, "rounding", PLAIN, experiment, hidden=())

    def outside(self, name: str, rig: str, k: int) -> Trial:
        rng = self._rng("outside", name, rig, k)
        hidden = self._hidden(rng, name, rig, "bench", RATIOS_OUTSIDE)
        return self._trial(rng, "outside", rig, experiment_for(name, rig), hidden=(hidden,))

    def two(self, pairs: Sequence[tuple[str, str]], rig: str, k: int) -> Trial:
        rng = self._rng("two", rig, k)
        pair = pairs[int(rng.integers(len(pairs)))]
        while set(pair) in ONE_TORQUE and any(set(other) not in ONE_TORQUE for other in pairs):
            pair = pairs[int(rng.integers(len(pairs)))]
        hidden = tuple(self._hidden(rng, name, rig, str(rng.choice(["table", "bench"])), RATIOS_TWO) for name in pair)
        found = [experiment_for(name, rig) for name in pair]
        experiment = next((e for e in found if e != "paper"), "paper")
        return self._trial(rng, "two", rig, experiment, hidden=hidden)

    def control(self, kind: str, rig: str, k: int) -> Trial:
        """Trials in which nothing is to be named, and hard friction alone."""
        rng = self._rng(kind, rig, k)
        experiment = ("paper", "paper", "wide", "hanging-chirp")[k % 4]
        more: dict[str, Any] = {"hidden": ()}
        if kind == "hard":
            more |= {"friction": "hard"}
        elif kind == "absorbed":
            name = ("back_emf", "amplifier_gain")[k % 2]
            more |= {"hidden": (Hidden(name, "bench", self._number(rng), strength=float(rng.uniform(0.3, 2.0))),)}
        elif kind == "torque_noise" and k % 2:
            strength = math.exp(rng.uniform(math.log(0.1), 0.0))
            more |= {"hidden": (Hidden("random_arm_torque", "bench", self._number(rng), strength=strength),)}
        elif kind == "torque_noise":
            more |= {"torque_noise": math.exp(rng.uniform(math.log(0.01), math.log(0.1)))}
        return self._trial(rng, kind, rig, experiment, **more)
