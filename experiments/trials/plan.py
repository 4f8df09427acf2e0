"""The plan of the trials: which rigs, what they hide and how large it is, before anything is simulated.

Every trial draws from its own generator, seeded by the split and its place in the plan, and its id is made of its
content: a larger plan contains the smaller one, and answers stay valid. The splits `dev` and `final` share no seed, no
individual rig and no scatter: thresholds may be chosen on `dev`, published error rates come from `final`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import groupby, zip_longest

from experiments.bench import SETS, catalogue
from furuta_gym.plant.effects import where_to_look

from .draws import COMPOSITE, Maker, allowed_pairs
from .trial import KINDS, PLAIN, SPLITS, Trial


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

    seeds: trials for each effect and kind of rig; the other kinds of trial follow in proportion (5: 620 library trials,
    120 of the bench without effect, 120 of the plain laboratory, 20 with hard friction alone, 56 from outside the
    library, 52 with two effects, 60 with three to five, and a strong effect for each effect and rig that can have it).
    effects, rigs, kinds: only these (default all); `effects` restricts what library and strong trials and pairs hide.
    share: a part of the plan, the same part of every effect and kind. power: library effects alone, down to gap
    ratios that nobody sees. seed: another one draws another world of the same split. Raises ValueError for names that
    do not exist and numbers out of range.
    """
    library = [name for name, e in catalogue().items() if e.kind == "library"]
    chosen = _among("effects", effects, library)
    wanted = set(_among("kinds", kinds, KINDS))
    if split not in SPLITS:
        raise ValueError(f"--split {split!r}: expected dev or final")
    if not 1 <= seeds <= 1000:
        raise ValueError(f"--seeds {seeds}: expected 1 to 1000")
    if not 0.0 < share <= 1.0:
        raise ValueError(f"--share {share:g}: expected more than 0 and at most 1")
    if seed < 0:
        raise ValueError(f"--seed {seed}: expected 0 or more")
    maker = Maker(SPLITS[split], ("power/" if power else "") + (f"seed {seed}/" if seed else ""))
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
        strong = [maker.strong(name, rig, k) for name in chosen for k in range(max(1, round(0.2 * seeds)))]
        trials += [trial for trial in strong if trial is not None]
        trials += [maker.composite(rig, k) for k in range(3 * seeds) if set(COMPOSITE) <= set(chosen)]
    if not power and not rigs:
        trials += [maker.rounding(k) for k in range(24 * seeds)]
    return _part([t for t in trials if t.kind in wanted], share)


def _among(what: str, given: Sequence[str], known: Sequence[str]) -> list[str]:
    strange = sorted(set(given) - set(known))
    if strange:
        there = where_to_look(strange, known) if what == "effects" else f"; there are {', '.join(known)}"
        raise ValueError(f"unknown {what}: {', '.join(strange)}{there}")
    return [name for name in known if name in given] if given else list(known)


def _part(trials: list[Trial], share: float) -> list[Trial]:
    """The same share of every stratum, in rounds over the rigs; shuffled by id."""

    def stratum(trial: Trial) -> str:
        return (
            trial.kind
            if trial.kind in ("two", "composite", "absorbed", "torque_noise")
            else f"{trial.kind} {trial.subject}"
        )

    kept: list[Trial] = []
    for _, group in groupby(sorted(trials, key=stratum), stratum):
        members = list(group)
        by_rig = [sorted((t for t in members if t.rig == rig), key=lambda t: t.id) for rig in (*SETS, PLAIN)]
        ordered = [t for row in zip_longest(*by_rig) for t in sorted(filter(None, row), key=lambda t: t.id)]
        kept += ordered[: math.ceil(share * len(ordered))]
    return sorted(kept, key=lambda t: t.id)
