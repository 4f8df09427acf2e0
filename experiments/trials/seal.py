"""The laboratory's side of a trial: build the rig, fit the strength to the wanted gap, write the logs, keep the truth.

What this module knows stays here and in the sealed file: `decide` gets a folder with two logs.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from experiments.bench import HiddenEffect, PendulumLost, Rig, effect_size, record

from . import sizes
from .rounding import seal_plain, write_plain
from .trial import DURATION, Hidden, Trial

FIT_LOG, HELD_OUT_LOG = "fit.csv", "held_out.csv"
_ROUNDS = 3
_CLOSE = 0.35  # of the logarithm of ratio − 1: the ratio that was reached is what counts, so near is enough
_GENTLER = 0.6


def seal(trial: Trial) -> dict[str, Any]:
    """Everything about the trial that its logs must not tell, for JSON.

    `strengths` and `ratios` (measured on this rig and experiment, None where none was asked) in the order of
    `trial.hidden`; `hard_ratio`, that of hard friction where it is the subject; `held_out` [experiment, seed]; `truth`
    as the bench tells it. If the pendulum falls whatever is tried, `problem` says so, and there is no truth.
    """
    if trial.kind == "rounding":
        return seal_plain(trial)
    found = [_sized(trial, hidden) for hidden in trial.hidden]
    strengths = [strength for strength, _ in found]
    ratios = [ratio for _, ratio in found]
    wanted = strengths
    sealed: dict[str, Any] = {"trial": trial.to_dict(), "subject": trial.subject}
    for _ in range(_ROUNDS):
        rig = _rig(trial, strengths)
        try:
            record(rig, trial.experiment, trial.seed, DURATION)
            held_out = _held_out(rig, trial)
            if strengths != wanted:
                sizes_now = zip(trial.hidden, strengths, strict=True)
                ratios = [_measured(trial, h, s) if h.ratio else None for h, s in sizes_now]
        except PendulumLost:
            strengths = [_GENTLER * s for s in strengths]
            continue
        more: dict[str, Any] = {"strengths": strengths, "ratios": ratios, "held_out": held_out, "truth": rig.truth()}
        if trial.kind == "hard":
            more["hard_ratio"] = effect_size(rig, trial.experiment, trial.seed, DURATION).ratio
        return sealed | more
    return sealed | {"problem": "the pendulum is lost"}


def write_logs(sealed: Mapping[str, Any], folder: Path) -> None:
    """Record the two logs of a sealed trial into a folder: what a laboratory would hand over, and nothing else."""
    if sealed["trial"]["kind"] == "rounding":
        write_plain(sealed, folder / FIT_LOG, folder / HELD_OUT_LOG)
        return
    trial, rig = rig_of(sealed)
    experiment, seed = sealed["held_out"]
    record(rig, trial.experiment, trial.seed, DURATION).write(folder / FIT_LOG)
    record(_shifted(rig, trial), experiment, seed, DURATION).write(folder / HELD_OUT_LOG)


def rig_of(sealed: Mapping[str, Any]) -> tuple[Trial, Rig]:
    """The trial and the rig of a sealed truth that has no `problem`."""
    about = sealed["trial"]
    zeros = tuple(about.get("zeros", (0.0, 0.0)))
    typed: dict[str, Any] = {**about, "hidden": tuple(Hidden(**h) for h in about["hidden"]), "zeros": zeros}
    trial = Trial(**typed)
    return trial, _rig(trial, sealed["strengths"])


def _shifted(rig: Rig, trial: Trial) -> Rig:
    """The rig when the held-out log is taken: its encoders may count from elsewhere."""
    arm, pendulum = rig.encoder_offset
    return replace(rig, encoder_offset=(arm + trial.zeros[0], pendulum + trial.zeros[1]))


def _bare(trial: Trial) -> Rig:
    rig = Rig(
        trial.rig,
        individual=trial.individual,
        scatter=trial.scatter,
        friction=trial.friction,
        encoder_counts=sizes.COUNTS,
        clock_jitter=trial.clock_jitter,
    )
    noise = [0.1 * (trial.torque_noise * level) ** 2 for level in rig.constants.coulomb]
    return replace(rig, torque_noise=(noise[0], noise[1]))


def _rig(trial: Trial, strengths: list[float]) -> Rig:
    return replace(_bare(trial), effects=[_effect(h, s) for h, s in zip(trial.hidden, strengths, strict=True)])


def _effect(hidden: Hidden, strength: float) -> HiddenEffect:
    return HiddenEffect(hidden.name, strength, hidden.form, hidden.variation)


def _measured(trial: Trial, hidden: Hidden, strength: float) -> float:
    """Gap ratio of one effect alone on the trial's rig; hard friction, which has a gap of its own, is left out."""
    rig = replace(_bare(trial), friction="smooth", effects=[_effect(hidden, strength)])
    return effect_size(rig, trial.experiment, trial.seed, DURATION).ratio


def _sized(trial: Trial, hidden: Hidden) -> tuple[float, float | None]:
    """(strength, its measured ratio) near the ratio that was asked for."""
    if hidden.ratio is None:
        assert hidden.strength is not None
        return hidden.strength, None
    largest = sizes.STRONGEST if trial.kind == "strong" else sizes.LARGEST
    strength = sizes.first_guess(hidden.name, trial.rig, trial.experiment, hidden.ratio, largest)
    best: tuple[float, float, float] | None = None
    for _ in range(_ROUNDS):
        try:
            ratio = _measured(trial, hidden, strength)
        except PendulumLost:
            strength *= 0.5
            continue
        miss = abs(math.log(max(ratio - 1.0, 1e-6) / (hidden.ratio - 1.0)))
        best = min(best or (math.inf, 0.0, 0.0), (miss, strength, ratio))
        other = min(largest, sizes.scaled(strength, ratio, hidden.ratio))
        if miss < _CLOSE or other == strength:
            break
        strength = other
    return best[1:] if best else (strength, None)


def _held_out(rig: Rig, trial: Trial) -> tuple[str, int]:
    """Experiment and seed of the held-out log; the fitted log's experiment if the pendulum falls in the other.

    Raises PendulumLost if it falls in all of them.
    """
    choices = [(name, trial.seed + shift) for name in (trial.held_out, trial.experiment) for shift in (1, 2)]
    for experiment, seed in choices[:-1]:
        try:
            record(_shifted(rig, trial), experiment, seed, DURATION)
        except PendulumLost:
            continue
        return experiment, seed
    record(_shifted(rig, trial), *choices[-1], DURATION)
    return choices[-1]
