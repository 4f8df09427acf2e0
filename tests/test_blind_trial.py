"""A small blind trial of the diagnosis as it is: logs of bench rigs in, names out, marked by the trials' own rules.

`furuta trials` is the large one; docs/diagnosis_trials.md has its results.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from experiments.trials.run import read_results, run_trials
from experiments.trials.scoring import Outcome, score
from experiments.trials.trial import Hidden, Trial

pytestmark = pytest.mark.timeout(1800)


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


STRIBECK = trial(1, "library", "workshop", effect("arm_stribeck", "table", 2.0))
CABLE = trial(3, "library", "workshop", effect("arm_spring", "table", 3.0))  # the bench's own law is arm_cable's
NOTHING = trial(5, "none", "servo")
OUTSIDE = trial(6, "outside", "workshop", effect("slipping_payload", "bench", 5.0))


def asked(sealed: Trial, folder: Path) -> Outcome:
    """The mark of one trial."""
    run_trials([sealed], folder, jobs=1)
    ((truth, answer),) = read_results([sealed], folder)
    return score(truth, answer)


@pytest.mark.thorough  # quicker ones that name what a bench hides: the demo, and tests/identification/diagnosis/naming
@pytest.mark.parametrize("sealed", [CABLE, STRIBECK], ids=lambda sealed: sealed.hidden[0].name)
def test_a_hidden_effect_is_named(sealed: Trial, tmp_path: Path) -> None:
    mark = asked(sealed, tmp_path)
    assert mark.right, mark


def test_nothing_is_named_where_nothing_is_hidden(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("experiments.trials.seal.DURATION", 10.0)  # half a log asks the same in half the time
    mark = asked(NOTHING, tmp_path)
    assert mark.result == "right", mark


@pytest.mark.thorough
def test_what_no_library_holds_is_not_given_a_name(tmp_path: Path) -> None:
    mark = asked(OUTSIDE, tmp_path)
    assert mark.result == "right", mark
