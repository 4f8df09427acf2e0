"""The rigs of a lab session: drawn as those of the blind trials are, and what each group gets of its own."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from experiments.bench import EXPERIMENTS, SETS, PendulumLost, Rig, record
from experiments.trials.draws import experiment_for
from experiments.trials.plan import make_plan
from experiments.trials.seal import FIT_LOG, HELD_OUT_LOG, rig_of, seal, write_logs
from experiments.trials.trial import DURATION, Trial
from furuta_gym.files import write_whole

from .vault import locked_text

SEALED, DATA_SHEET, MORE = "sealed.json", "data_sheet.md", "more"

WEIGHTS = {"library": 3.0, "two": 1.0, "none": 1.0, "outside": 1.0}
"""What a rig can hide, and how often beside the others."""

KINDS = ("library", "none")
"""What the rigs of a session hide unless a teacher asks for more."""

PLAIN = 2.0
"""The least gap ratio that is asked for: a lab session is no test of the eyes."""

EXPERIMENT = "paper"
"""Of every log to fit. The trials choose it by what is hidden, so here it would tell."""

MOST = 40
"""Groups of one session."""


def draw(
    groups: int,
    secret: int,
    kinds: Sequence[str] = KINDS,
    effects: Sequence[str] = (),
    rigs: Sequence[str] = (),
    seal: Callable[[Trial], dict[str, Any]] = seal,
) -> list[dict[str, Any]]:
    """The sealed truths of `groups` rigs, which follow from `secret`.

    kinds: of WEIGHTS. effects, rigs: only these (default all). seal(trial): its truth, or a `problem`.
    Only rigs whose log to fit is of EXPERIMENT. Raises ValueError for names and numbers that do not exist, for effects
    that need another experiment, and where too few rigs are left.
    """
    if not 1 <= groups <= MOST:
        raise ValueError(f"{groups} groups given, expected 1 to {MOST}")
    if strange := sorted(set(kinds) - set(WEIGHTS)):
        raise ValueError(f"unknown kinds: {', '.join(strange)}; there are {', '.join(WEIGHTS)}")
    plan, first = [], max(2, groups // 3)
    for seeds in (first, 2 * first, 4 * first):  # of some kinds few rigs are plain to see
        if len(plan) < groups:
            drawn = make_plan("dev", seeds, effects, rigs, kinds or KINDS, seed=secret)
            plan = [trial for trial in drawn if trial.experiment == EXPERIMENT and _plain(trial)]
    sets = rigs or list(SETS)
    if hardly := [name for name in effects if all(experiment_for(name, rig) != EXPERIMENT for rig in sets)]:
        raise ValueError(
            f"every log to fit is of the experiment {EXPERIMENT!r}, which hardly shows {', '.join(hardly)} on rigs of "
            f"{', '.join(sets)}; expected other effects"
        )
    waiting = {kind: [trial for trial in plan if trial.kind == kind] for kind in WEIGHTS}
    rng = np.random.default_rng([secret, 0x1AB])
    found: list[dict[str, Any]] = []
    while len(found) < groups:
        left = [kind for kind in WEIGHTS if waiting[kind]]
        if not left:
            raise ValueError(
                f"only {len(found)} rigs for {groups} groups: ask for fewer groups, or more kinds, effects or rigs"
            )
        weights = np.array([WEIGHTS[kind] for kind in left])
        kind = str(rng.choice(left, p=weights / weights.sum()))
        truth = seal(waiting[kind].pop(0))
        if "problem" not in truth:
            found.append(truth)
    return found


def _plain(trial: Trial) -> bool:
    return all(h.ratio is None or h.ratio >= PLAIN for h in trial.hidden)


def hand_out(sealed: Mapping[str, Any], folder: Path, passphrase: str) -> None:
    """Write what one group gets: two logs, logs of other experiments in `more`, a data sheet, the sealed truth."""
    folder.mkdir(parents=True)
    write_logs(sealed, folder)
    trial, rig = rig_of(sealed)
    held_out, _ = sealed["held_out"]
    logs = {FIT_LOG: trial.experiment, HELD_OUT_LOG: held_out}
    (folder / MORE).mkdir()
    for number, name in enumerate(name for name in EXPERIMENTS if name != "long"):
        try:
            run = record(rig, name, trial.seed + 10 + number, DURATION)
        except PendulumLost:
            continue  # as at a real rig: this experiment cannot be had
        run.write(folder / MORE / f"{name}.csv")
        logs[f"{MORE}/{name}.csv"] = name
    write_whole(folder / DATA_SHEET, data_sheet(rig, logs))
    write_whole(folder / SEALED, locked_text(sealed, passphrase))


def data_sheet(rig: Rig, logs: Mapping[str, str]) -> str:
    """What a laboratory would know of a rig and of its logs (file → experiment), in Markdown."""
    arm, pendulum = rig.counts
    lines = [
        "# Data sheet\n",
        "| what | value |",
        "|---|---|",
        f"| command u | {rig.kind.unit}, at most ±{rig.kind.u_max:g} {rig.kind.unit} |",
        f"| encoder of the arm, q1 | {arm} counts a turn |",
        f"| encoder of the pendulum, q2 | {pendulum} counts a turn, zero upright |",
        f"| sample time | {1000 * rig.period:g} ms |",
        f"| length of a log | {DURATION:g} s |\n",
        "| log | experiment |",
        "|---|---|",
        *(f"| {file} | {EXPERIMENTS[name].says} |" for file, name in logs.items()),
    ]
    return "\n".join(lines) + "\n"
