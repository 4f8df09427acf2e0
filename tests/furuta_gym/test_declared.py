"""What does not fit a declaration is said in words: where, what was expected and what it means, what was got."""

from __future__ import annotations

import re
import time
from typing import Any

import numpy as np
import pytest
from msgspec import inspect

from controllers.comparison.result import ComparisonFile
from controllers.learned.policy_file import NetworkEntry
from controllers.training.resuming import Progress
from furuta_gym.declared import checked, plain, written
from furuta_gym.plant import QUBE
from furuta_gym.plant.plant_file import FIELDS, LimitsEntry, PlantFile
from identification.diagnosis.diagnosis_file import DiagnosisFile

WHOLE = QUBE.to_dict()
SPRING = {"name": "arm_spring", "parameters": {"k": {"value": 0.3}, "q1n": "x"}}

SAID: dict[str, tuple[dict[str, Any], str]] = {
    "a number": ({"u_max": "ten"}, "u_max must be a number in [1e-09, 1e+09] (largest command), got 'ten'"),
    "a truth value": (
        {"sample_time": True},
        "sample_time must be a number in [1e-06, 1] or null (control period in s), got True",
    ),
    "a choice": ({"unit": "mV"}, 'unit must be "N·m" or "V" (of the command), got \'mV\''),
    "missing": ({"theta": {"theta1": 1.0}}, 'theta needs "theta2", and has theta1'),
    "unknown": ({"limits": {"arm": 1}}, "limits has no 'arm'; it takes arm_travel (largest angle of the arm"),
    "in a mapping": (
        {"effects": [SPRING]},
        "effects[arm_spring].parameters.q1n must be a mapping or a number in [-1e+100, 1e+100] or null, got 'x'",
    ),
    "in a list": (
        {"provenance": {"logs": [{}, {"sha256": 1}]}},
        "provenance.logs[1].sha256 must be a text or null (hash of the file), got 1",
    ),
    "a length": (
        {"friction_sharpness": []},
        "friction_sharpness must be a number in (0, 1e+06] or a list of 1 or 2, each a number in (0, 1e+06] (r of",
    ),
    "a key": ({"checks": {1: 2}}, "checks must have texts as keys, got {1: 2}"),
    "too long": ({"unit": "x" * 1000}, "got '" + "x" * 79),
}


@pytest.mark.parametrize("case", SAID)
def test_what_is_said(case: str) -> None:
    changes, words = SAID[case]
    with pytest.raises(ValueError, match=re.escape(words)) as found:
        checked(WHOLE | changes, PlantFile)
    assert len(str(found.value)) < 500


def test_a_part_is_named_as_the_whole_is() -> None:
    with pytest.raises(ValueError, match=r"^limits\.slew must be a number in \(0, 1e\+09\] .*, got 0$"):
        checked({"slew": 0}, FIELDS["limits"], "limits")
    with pytest.raises(ValueError, match=r'^the file needs "schema", and has theta$'):
        checked({"theta": WHOLE["theta"]}, PlantFile)
    with pytest.raises(ValueError, match=r"^the file must be a mapping, got \[1\]$"):
        checked([1], PlantFile)


@pytest.mark.parametrize(
    "key", ["a - at `$.b`", "a - at `$.b", "`", "\n", "\x1b[31m", "\ud800", "x" * 1000, "", "a.b[0]"]
)
def test_keys_of_strangers_break_no_message(key: str) -> None:
    for part in (
        {"limits": {key: 1}},
        {"checks": {key: 1}, "unit": key},
        {"effects": [{"name": "arm_spring", "parameters": {"k": 1, key: "x"}}]},
        {"effects": [{"name": key, "parameters": {"k": "x"}}]},
        {"effects": [{key: 1}]},
    ):
        with pytest.raises(ValueError, match=r"(?s).") as found:
            checked(WHOLE | part, PlantFile)
        assert len(str(found.value).encode()) < 500
        assert str(found.value).isprintable()
    with pytest.raises(ValueError, match=r"^limits (has no|must have texts as keys)"):
        checked({key: 1}, FIELDS["limits"], "limits")


def test_numbers_of_numpy_are_numbers_and_texts_are_none() -> None:
    data = WHOLE | {"u_max": np.float32(2.0), "friction_sharpness": np.array([1.0, 2.0]), "sensors": {"offset": (0, 1)}}
    read = checked(data, PlantFile)
    assert (read.u_max, read.friction_sharpness, read.sensors.offset) == (2.0, [1.0, 2.0], [0.0, 1.0])
    assert plain({"a": (np.int64(1), np.zeros(2))}) == {"a": [1, [0.0, 0.0]]}


def test_the_wrong_one_of_many_keys_is_found_soon() -> None:
    many: dict[str, Any] = {f"p{i}": 0.0 for i in range(50_000)}
    began = time.process_time()
    with pytest.raises(ValueError, match=r"parameters\.p31234 must be"):
        checked(WHOLE | {"effects": [{"name": "arm_spring", "parameters": many | {"p31234": []}}]}, PlantFile)
    assert time.process_time() - began < 5.0


def test_what_was_not_said_is_not_written() -> None:
    assert written(LimitsEntry(slew=2.0)) == {"slew": 2.0}


@pytest.mark.parametrize("declared", [PlantFile, DiagnosisFile, ComparisonFile, NetworkEntry, Progress])
def test_no_declaration_has_a_tuple(declared: type) -> None:
    """msgspec reads the length of a tuple from the wrong place where a bounded number is its alternative."""
    assert not re.search(r"\bTupleType", str(inspect.type_info(declared)))
