"""The plan of the trials: which rigs, what they hide and how large it is, before anything is simulated.

Every trial draws from its own generator, seeded by the split and its place in the plan, and its id is made of its
content: a larger plan contains the smaller one, and answers stay valid. The splits `dev` and `final` share no seed, no
individual rig and no scatter: thresholds may be chosen on `dev`, published error rates come from `final`.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import combinations, groupby, zip_longest
from typing import Any

import numpy as np

from experiments.bench import SETS, catalogue

from . import sizes

KINDS = ("library", "none", "torque_noise", "absorbed", "hard", "outside", "two")
RATIOS = (1.1, 10.0)
RATIOS_OUTSIDE = (1.5, 10.0)
RATIOS_TWO = (1.3, 5.0)
RATIOS_POWER = (1.005, 3.0)
DURATION = 20.0
"""Length [s] of every log."""

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

_NO_HARD_FRICTION = {"arm_presliding", "friction_sharpness"}  # they replace the friction that would be hard


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
    friction. `id`: from all the rest, but tells nothing of it."""

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

    @property
    def subject(self) -> str:
        """What is asked: the hidden names, or the kind where nothing is to be named."""
        return "+".join(h.name for h in self.hidden) or self.kind

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


def make_plan(
    split: str = "dev",
    seeds: int = 5,
    effects: Sequence[str] = (),
    rigs: Sequence[str] = (),
    kinds: Sequence[str] = (),
    share: float = 1.0,
    power: bool = False,
    seed: int = 0,
) -> list[Trial]:
    """The trials, in an order that tells nothing.

    seeds: trials for each effect and kind of rig; the other kinds of trial follow in proportion (5: 600 library trials,
    120 without effect, 20 with hard friction alone, 56 from outside the library, 52 with two effects).
    effects, rigs, kinds: only these (default all); `effects` restricts what library trials and pairs hide.
    share: a part of the plan, the same part of every effect and kind. power: library effects alone, down to gap
    ratios that nobody sees. seed: another one draws another world of the same split. Raises ValueError for names that
    do not exist and numbers out of range.
    """
    library = [name for name, e in catalogue().items() if e.kind == "library"]
    chosen = _among("effects", effects, library)
    wanted = set(_among("kinds", kinds, KINDS))
    if split not in SPLITS:
        raise ValueError(f"split {split!r} given, expected dev or final")
    if not 1 <= seeds <= 1000:
        raise ValueError(f"seeds {seeds} given, expected 1 to 1000")
    if not 0.0 < share <= 1.0:
        raise ValueError(f"share {share} given, expected more than 0 and at most 1")
    if seed < 0:
        raise ValueError(f"seed {seed} given, expected 0 or more")
    maker = _Maker(SPLITS[split], ("power/" if power else "") + (f"seed {seed}/" if seed else ""))
    trials: list[Trial] = []
    for rig in _among("rigs", rigs, list(SETS)):
        for k in range(seeds):
            trials += [maker.library(name, rig, k, power) for name in chosen]
        if power:
            continue
        for k in range(2 * seeds):
            trials += [maker.control(kind, rig, k) for kind in ("none", "torque_noise", "absorbed")]
        trials += [maker.control("hard", rig, k) for k in range(seeds)]
        for k in range(max(1, round(0.4 * seeds))):
            trials += [maker.outside(name, rig, k) for name, e in catalogue().items() if e.kind == "outside"]
        pairs = allowed_pairs(chosen)
        trials += [maker.two(pairs, rig, k) for k in range(max(1, round(2.6 * seeds)) if pairs else 0)]
    return _part([t for t in trials if t.kind in wanted], share)


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


_HELD_OUT = {"paper": "steps", "wide": "paper", "hanging-chirp": "free-decay"}


class _Maker:
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

    def outside(self, name: str, rig: str, k: int) -> Trial:
        rng = self._rng("outside", name, rig, k)
        hidden = self._hidden(rng, name, rig, "bench", RATIOS_OUTSIDE)
        return self._trial(rng, "outside", rig, experiment_for(name, rig), hidden=(hidden,))

    def two(self, pairs: Sequence[tuple[str, str]], rig: str, k: int) -> Trial:
        rng = self._rng("two", rig, k)
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


def _among(what: str, given: Sequence[str], known: Sequence[str]) -> list[str]:
    strange = sorted(set(given) - set(known))
    if strange:
        raise ValueError(f"unknown {what}: {', '.join(strange)}; there are {', '.join(known)}")
    return [name for name in known if name in given] if given else list(known)


def _part(trials: list[Trial], share: float) -> list[Trial]:
    """The same share of every stratum, in rounds over the rigs; shuffled by id."""

    def stratum(trial: Trial) -> str:
        return trial.kind if trial.kind in ("two", "absorbed", "torque_noise") else f"{trial.kind} {trial.subject}"

    kept: list[Trial] = []
    for _, group in groupby(sorted(trials, key=stratum), stratum):
        members = list(group)
        by_rig = [sorted((t for t in members if t.rig == rig), key=lambda t: t.id) for rig in SETS]
        ordered = [t for row in zip_longest(*by_rig) for t in sorted(filter(None, row), key=lambda t: t.id)]
        kept += ordered[: math.ceil(share * len(ordered))]
    return sorted(kept, key=lambda t: t.id)
