"""A small part of `python -m experiments.studies.hard_use`: kills, full disks, and what is a fault."""

from __future__ import annotations

import os
import random
from pathlib import Path

import pytest

from experiments.studies.hard_use import disks
from experiments.studies.hard_use.cases import CASES, Case
from experiments.studies.hard_use.disks import full_disk
from experiments.studies.hard_use.kills import _found, kill_at_random
from experiments.studies.hard_use.laboratory import Laboratory, Outcome, whole

pytestmark = pytest.mark.skipif(os.name == "nt", reason="kill -9 is POSIX's")


@pytest.mark.parametrize("name", ["export-mjcf", "simulate-npz"])
def test_kills(name: str, tmp_path: Path) -> None:
    outcome = kill_at_random(Laboratory(tmp_path / "room"), name, CASES[name], 2, random.Random(1))
    assert outcome.faults == []
    killed = outcome.counts.total() - outcome.counts["ended"]  # on a fast machine a run may end before its kill
    assert killed == 2


def test_a_full_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With a limit on the size of files, which needs no right to mount."""
    from contextlib import nullcontext

    monkeypatch.setattr(disks, "small_disk", lambda place, size: nullcontext(False))
    monkeypatch.setattr(disks, "FREE", (0, 1000))
    outcome = full_disk(Laboratory(tmp_path / "room"), "export-mjcf", CASES["export-mjcf"])
    assert outcome.faults == []
    assert outcome.counts == {"0 bytes free: exit code 2": 1, "1000 bytes free: exit code 2": 1}


def test_files_that_were_cut_are_seen(tmp_path: Path) -> None:
    room = Laboratory(tmp_path / "room")
    (room.outputs / "rig.json").write_text('{"theta": ')
    outcome = Outcome()
    assert _found(room, Case("", ("rig.json",)), {}, 0.0, outcome) == "broken"
    assert outcome.faults == ["not whole: ['rig.json']"]
    for name, cut in {
        "a.csv": b"t,q1\n1,2\n3",
        "a.zip": b"PK\x03\x04",
        "a.png": b"\x89PNG",
        "a.html": b"<html>",
    }.items():
        assert not whole(name, cut)
    assert whole("a.csv", b"# device: a, b\nt,q1\n1,2\n")
