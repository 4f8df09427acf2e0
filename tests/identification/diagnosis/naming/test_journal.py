"""A search that was stopped goes on from its journal and ends where it would have ended."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from furuta_gym.plant import TABLE_3
from identification import diagnose
from identification.diagnosis.naming.fits import Fit, FitRequest, fit
from identification.diagnosis.naming.journal import FitJournal
from identification.diagnosis.outcome import Diagnosis
from identification.kalman.noise_model import Noise
from identification.kalman.record import Record
from identification.logs.log import Log
from tests.factories import loop_log

ONLY = ("arm_spring", "arm_ripple", "input_offset")
NOISE = Noise((1e-4, 1e-6), (0.5, 0.5))


@pytest.fixture(scope="module")
def log() -> Log:
    return loop_log("arm_spring", duration=4.0, T=0.004)[0]


class Stopped(Exception):
    """As Ctrl-C ends a search."""


def searched(log: Log, journal: Path | None, steps: int | None = None) -> Diagnosis:
    """The diagnosis of a log, stopped at its `steps`-th word if that is given."""
    said: list[str] = []

    def progress(text: str) -> None:
        said.append(text)
        if len(said) == steps:
            raise Stopped(text)

    return diagnose(log, only=ONLY, progress=progress, journal=journal)


def answer(found: Diagnosis) -> dict[str, Any]:
    told = found.to_dict()
    told.pop("runtime_s", None)
    return told


def test_a_stopped_search_goes_on_and_ends_the_same(log: Log, tmp_path: Path) -> None:
    expected = answer(searched(log, None))
    rng = np.random.default_rng(7)
    for i, steps in enumerate(rng.integers(4, 10, 3)):
        journal = tmp_path / f"search{i}.jsonl"
        with pytest.raises(Stopped):
            searched(log, journal, int(steps))
        text = journal.read_text()
        kept = FitJournal(journal)
        assert len(kept) == len(text.splitlines()) > 0
        journal.write_text(text[:-7])  # the last line was cut off by a kill
        assert answer(searched(log, journal)) == expected
        lines = journal.read_text().splitlines()
        assert len(FitJournal(journal)) == len(lines) - 1 > len(kept)  # all but the line that was cut off


def test_a_fit_is_taken_for_the_very_same_question_only(log: Log, tmp_path: Path) -> None:
    journal = FitJournal(tmp_path / "fits.jsonl")
    records = (Record.from_log(log),)
    first = journal(FitRequest(TABLE_3, NOISE, records, iterations=2, effort="coarse"))
    again = FitJournal(journal.path)
    second = again(FitRequest(TABLE_3, NOISE, records, iterations=2, effort="coarse"))
    assert again.used == 1
    np.testing.assert_array_equal(second.plant.theta, first.plant.theta)
    assert second.value == first.value
    np.testing.assert_array_equal(second.noise.packed(), first.noise.packed())
    moved = replace(records[0], y=records[0].y + 1e-6)
    for plant, noise, given in (
        (TABLE_3.replace(theta=1.001 * TABLE_3.theta), NOISE, records),
        (TABLE_3, Noise((2e-4, 1e-6), (0.5, 0.5)), records),
        (TABLE_3, NOISE, (moved,)),
    ):
        again(FitRequest(plant, noise, given, iterations=2, effort="coarse"))
    again(FitRequest(TABLE_3, NOISE, records, iterations=1, effort="coarse"))
    assert again.used == 1
    again(FitRequest(TABLE_3, NOISE, records, iterations=1, effort="coarse"))
    assert again.used == 2


def test_a_broken_journal_is_no_worse_than_none(log: Log, tmp_path: Path) -> None:
    path = tmp_path / "fits.jsonl"
    calls: list[int] = []

    def counting(request: FitRequest) -> Fit:
        calls.append(1)
        return fit(request)

    records = (Record.from_log(log),)
    FitJournal(path)(FitRequest(TABLE_3, NOISE, records, iterations=1, effort="coarse"))
    told = json.loads(path.read_text())
    for broken in ("", "nonsense", "[]", "{}", json.dumps(told | {"z": [1.0]}), json.dumps(told | {"z": ["a"]})):
        path.write_text(broken + "\n")
        FitJournal(path, counting)(FitRequest(TABLE_3, NOISE, records, iterations=1, effort="coarse"))
    assert len(calls) == 6
    nowhere = FitJournal(tmp_path / "missing" / "fits.jsonl", counting)
    nowhere(FitRequest(TABLE_3, NOISE, records, iterations=1, effort="coarse"))
    assert len(calls) == 7


def test_a_fit_from_the_journal_knows_its_information(log: Log, tmp_path: Path) -> None:
    """From which the search decides where a fit without one of the effects starts."""
    journal = FitJournal(tmp_path / "fits.jsonl")
    records = (Record.from_log(log),)
    made = journal(FitRequest(TABLE_3, NOISE, records, iterations=2, effort="coarse"))
    kept = FitJournal(journal.path)(FitRequest(TABLE_3, NOISE, records, iterations=2, effort="coarse"))
    np.testing.assert_array_equal(kept.optimum.expansion.information, made.optimum.expansion.information)
    assert np.any(made.optimum.expansion.information)
    assert kept.promised == made.promised > 0.0
