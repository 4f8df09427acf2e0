"""What the plant file of a diagnosis says of where its numbers come from."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from furuta_gym.plant import TABLE_3
from identification.diagnosis import searched
from identification.diagnosis.origin import with_origin
from identification.diagnosis.policy import DecisionPolicy
from identification.estimation.identify import identify
from tests.factories import loop_log
from tests.identification.diagnosis.fits import naming, suspect


def test_a_fit_that_the_search_made_was_not_started_by_the_user(monkeypatch: pytest.MonkeyPatch) -> None:
    log = loop_log(duration=3.0)[0]
    refitted = identify(log, TABLE_3, "filtered-ls")
    assert refitted.plant.provenance["start"] == "a plant given"
    before: Any = SimpleNamespace(plant=TABLE_3.replace(provenance={"start": "from the logs", "u_max": "given"}))
    monkeypatch.setattr(searched, "identify", lambda *_, **__: refitted)
    found = searched._without_sharpness(before, naming(suspect("friction_sharpness", 50.0)), [log], DecisionPolicy())
    for told in (found, with_origin(refitted, before.plant)):
        assert told.plant.provenance["start"] == "the search for missing effects"
        assert told.plant.provenance["u_max"] == "given"
    other = searched._without_sharpness(before, naming(suspect("arm_spring", 50.0)), [log], DecisionPolicy())
    assert other is before
