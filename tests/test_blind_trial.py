"""A small blind trial of the diagnosis as it is: logs of bench rigs in, names out, marked by the trials' own rules.

`furuta trials` is the large one; docs/diagnosis_trials.md has its results.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from experiments.trials.run import read_results, run_trials
from experiments.trials.scoring import Outcome, score
from experiments.trials.trial import Hidden, Trial

pytestmark = pytest.mark.timeout(1800)
LONG = bool(os.environ.get("FURUTA_STUDIES"))


def trial(number: int, kind: str, rig: str, *hidden: Hidden, experiment: str = "paper", **more: Any) -> Trial:
    return Trial(
        id=f"small-{number}",
        kind=kind,
        rig=rig,
        hidden=hidden,
        experiment=experiment,
        held_out=experiment,
        seed=3_000_000 + 10 * number,  # of no trial of either split
        individual=3_000_000 + number,
        scatter=0.08,
        clock_jitter=0.0,
        **more,
    )


def effect(name: str, form: str, ratio: float) -> Hidden:
    return Hidden(name, form, variation=3_000_001, ratio=ratio)


NAMED = [
    trial(1, "library", "workshop", effect("arm_stribeck", "table", 2.0)),
    trial(3, "library", "workshop", effect("arm_spring", "table", 3.0)),  # the bench's own law stiffens: arm_cable's
]
NOTHING = trial(5, "none", "servo")
OUTSIDE = trial(6, "outside", "workshop", effect("slipping_payload", "bench", 5.0))


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Outcome]:
    folder: Path = tmp_path_factory.mktemp("blind")
    plan = [*NAMED, NOTHING, *([OUTSIDE] if LONG else [])]
    run_trials(plan, folder, jobs=2)
    results = read_results(plan, folder)
    return {o.id: o for o in (score(sealed, answer) for sealed, answer in results)}


def test_hidden_effects_are_named(outcomes: dict[str, Outcome]) -> None:
    marks = [outcomes[t.id] for t in NAMED]
    assert all(o.right for o in marks), [(o.subject, o.ratio, o.result, o.named) for o in marks]


def test_nothing_is_named_where_nothing_is_hidden(outcomes: dict[str, Outcome]) -> None:
    assert outcomes[NOTHING.id].result == "right", outcomes[NOTHING.id]


@pytest.mark.skipif(not LONG, reason="takes minutes: run it with FURUTA_STUDIES=1")
def test_what_no_library_holds_is_not_given_a_name(outcomes: dict[str, Outcome]) -> None:
    assert outcomes[OUTSIDE.id].result == "right", outcomes[OUTSIDE.id]
