"""Damaged and hostile files, a small part of `python -m experiments.studies.hard_files`: a value or a sentence."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from hypothesis import given, seed, settings
from hypothesis import strategies as st

from experiments.studies.hard_files.bags import bag_case, try_bag
from experiments.studies.hard_files.logs import log_case, try_log
from experiments.studies.hard_files.others import plant_case, policy_case, try_plant, try_policy
from identification.logs import formats

NUMBERS = st.integers(0, 2**40)


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("hard")


@seed(20)
@settings(max_examples=1000)
@given(number=NUMBERS)
def test_logs(number: int, room: Path) -> None:
    try_log(log_case(random.Random(number)), room)


@seed(20)
@settings(max_examples=6)
@given(number=NUMBERS)
def test_logs_of_matlab(number: int, room: Path) -> None:
    try_log(log_case(random.Random(number), (".mat",)), room)


@seed(20)
@settings(max_examples=6)
@given(number=NUMBERS)
def test_bags(number: int, room: Path, monkeypatch_module: pytest.MonkeyPatch) -> None:
    pytest.importorskip("rosbags")
    pytest.importorskip("mcap")
    monkeypatch_module.chdir(room)
    try_bag(*bag_case(random.Random(number)), room)
    assert not (room / "it-ran").exists()


@seed(20)
@settings(max_examples=1000)
@given(number=NUMBERS)
def test_plants(number: int, room: Path) -> None:
    try_plant(plant_case(random.Random(number)), room, play=False)


@seed(20)
@settings(max_examples=400)
@given(number=NUMBERS)
def test_policies(number: int, room: Path, monkeypatch_module: pytest.MonkeyPatch) -> None:
    monkeypatch_module.chdir(room)
    try_policy(policy_case(random.Random(number)), room)
    assert not (room / "it-ran").exists()


@pytest.fixture(scope="module")
def monkeypatch_module():
    with pytest.MonkeyPatch.context() as patch:
        yield patch


def test_some_are_read_and_some_are_refused(room: Path) -> None:
    """Else the cases would test one branch only."""
    cases = {
        "logs": [try_log(log_case(random.Random(n), (".csv", ".npz")), room) for n in range(120)],
        "plants": [try_plant(plant_case(random.Random(n)), room, play=False) for n in range(60)],
        "policies": [try_policy(policy_case(random.Random(n)), room) for n in range(30)],
    }
    for kind, found in cases.items():
        assert {"read", "refused"} == set(found), kind


def test_a_fault_is_noticed(room: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A reader that lets a library's error through fails the cases."""

    def careless(path: Path) -> formats.Table:
        raise KeyError("t")

    monkeypatch.setitem(formats.READERS, ".csv", careless)
    with pytest.raises(KeyError):
        try_log(log_case(random.Random(1), (".csv",)), room)
