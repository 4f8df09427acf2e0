"""Trials of rounding alone: rigs of the plain laboratory, which shares no code with the bench."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from experiments.bench.plain_lab import PlainRig, a_log, a_rig
from furuta_gym.files import write_whole

from .trial import DURATION, Trial

_TRIES = 20  # rigs, until one keeps its pendulum up in both logs


def seal_plain(trial: Trial) -> dict[str, Any]:
    """The sealed truth of a trial of the kind "rounding", for JSON: as `seal.seal` gives it, the rig under `plain`."""
    sealed = {"trial": trial.to_dict(), "subject": trial.subject}
    for individual in range(trial.individual, trial.individual + _TRIES):
        rig = a_rig(individual)
        try:
            a_log(rig, trial.experiment, trial.seed, DURATION)
            a_log(rig, trial.held_out, trial.seed + 1, DURATION)
        except ValueError:
            continue
        more = {"strengths": [], "ratios": [], "held_out": [trial.held_out, trial.seed + 1]}
        return sealed | more | {"truth": {"effects": []}, "plain": asdict(rig)}
    return sealed | {"problem": "the pendulum is lost"}


def write_plain(sealed: Mapping[str, Any], fit: Path, held_out: Path) -> None:
    """Record both logs of a sealed trial of this kind."""
    about = sealed["plain"]
    typed: dict[str, Any] = {**about, "theta": tuple(about["theta"]), "cable": tuple(about["cable"])}
    rig = PlainRig(**typed)
    trial = sealed["trial"]
    for path, (experiment, seed) in ((fit, (trial["experiment"], trial["seed"])), (held_out, sealed["held_out"])):
        log = a_log(rig, experiment, seed, DURATION)
        lines = ["# input_unit: V", "# pendulum_zero: upright", f"# encoder_counts: {rig.counts} {rig.counts}"]
        lines += ["# device: bench rig", "t,q1,q2,u"]
        rows = np.column_stack([log[name] for name in ("t", "q1", "q2", "u")])
        lines += [f"{t:.9f},{a:.10g},{b:.10g},{u:.10g}" for t, a, b, u in rows.tolist()]
        write_whole(path, "\n".join(lines) + "\n")
