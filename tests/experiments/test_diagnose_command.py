"""What `furuta diagnose` writes and says where the logs show no plant."""

from __future__ import annotations

import errno
import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec import UNSET

from experiments.cli.diagnose import _repeated
from furuta_gym.declared import checked
from identification import write_log
from identification.diagnosis.diagnose import diagnose
from identification.diagnosis.diagnosis_file import DiagnosisFile
from tests.commands import furuta, refused, some_log
from tests.factories import loop_log


def test_without_a_plant_there_is_no_file_of_one_and_it_says_why(tmp_path: Path) -> None:
    """As docs/reference/diagnosis_file.md has it; the plant of an earlier run does not stay either."""
    log = some_log(tmp_path / "log.csv", q1=np.zeros(400))
    folder = tmp_path / "found"
    folder.mkdir()
    (folder / "plant.json").write_text("of an earlier run")
    result = furuta("diagnose", log, "-o", folder)
    assert result.exit_code == 0, result.output
    written = json.loads((folder / "diagnosis.json").read_text(encoding="utf-8"))
    assert written["verdict"] == "insufficient_excitation"
    assert written["where"] is None
    assert written["gap"] is None
    assert written["effects"] == written["ranking"] == []
    assert written["next_experiment"]
    assert not (folder / "plant.json").exists()
    for part in ("where", "gap"):
        assert "too little to fit a plant" in written["remarks"][part]
    assert "there is no plant.json: these logs move the rig too little" in result.stdout
    assert "not known" in result.stdout


@pytest.mark.parametrize("first", [["--held-out", "b.csv"], ["--held-out=b.csv"]])
def test_logs_after_one_held_out_are_held_out_as_well(first: list[str]) -> None:
    """With a space and with an equals sign: none of them is fitted."""
    given = _repeated(["a.csv", *first, "c.csv", "-o", "found"], "--held-out", lambda before: "a.csv" in before)
    assert given == ["a.csv", "--held-out", "b.csv", "--held-out", "c.csv", "-o", "found"]


def test_a_full_disk_at_the_end_loses_no_search(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The journal stays until the results are on the disk."""
    log = some_log(tmp_path / "log.csv", q1=np.zeros(400))
    journal = tmp_path / "found.search.jsonl"

    def searched(*given: Any, **more: Any) -> Any:
        journal.write_text("a fit")
        return diagnose(*given, **more)

    def full(folder: Path) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("identification.diagnosis.diagnose.diagnose", searched)
    with monkeypatch.context() as context:
        context.setattr("experiments.cli.whole._sync", full)
        result = furuta("diagnose", log, "-o", tmp_path / "found")
        assert result.exit_code == 2
        assert "No space left" in result.stderr
    assert journal.exists()
    assert furuta("diagnose", log, "-o", tmp_path / "found").exit_code == 0
    assert not journal.exists()


def test_a_search_that_its_time_ended_says_so_and_can_go_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = tmp_path / "log.csv"
    write_log(log, loop_log("arm_spring", 0.3, duration=4.0)[0])
    journal = tmp_path / "found.search.jsonl"

    def searched(*given: Any, **more: Any) -> Any:
        return diagnose(*given, **more, only=["arm_spring"])

    monkeypatch.setattr("identification.diagnosis.diagnose.diagnose", searched)
    refused(furuta("diagnose", log, "-o", tmp_path / "found", "--minutes", "0"), "--minutes 0", "more than 0")
    with monkeypatch.context() as context:  # nor is anything exchanged then
        context.setattr("identification.diagnosis.searched.preferred", lambda *_: pytest.fail("it was asked"))
        result = furuta("diagnose", log, "-o", tmp_path / "found", "--minutes", "1e-9")
    assert result.exit_code == 0, result.output
    found = json.loads((tmp_path / "found" / "diagnosis.json").read_text())
    assert found["ended_early"]
    assert [effect["name"] for effect in found["effects"]] == ["arm_spring"]
    assert "more effects may be missing" in found["summary"]
    assert "more effects may be missing" in (tmp_path / "found" / "report.html").read_text(encoding="utf-8")
    assert found["next_experiment"].startswith("To look for more, give the same command more --minutes")
    assert journal.exists()
    result = furuta("diagnose", log, "-o", tmp_path / "found")
    assert "goes on" in result.stderr or "keeps" in result.stderr
    assert not json.loads((tmp_path / "found" / "diagnosis.json").read_text())["ended_early"]
    assert not journal.exists()


def test_a_mistyped_command_leaves_the_fits_of_a_stopped_search(tmp_path: Path) -> None:
    log = some_log(tmp_path / "log.csv", q1=np.zeros(400))
    journal = tmp_path / "found.search.jsonl"
    journal.write_text("")
    refused(furuta("diagnose", log, "--held-out", log, "-o", tmp_path / "found"), "searched and held out at once")
    assert journal.exists()


def test_a_search_that_cannot_end_leaves_no_journal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = some_log(tmp_path / "log.csv", q1=np.zeros(400))

    def searched(*_: Any, journal: Path, **__: Any) -> None:
        journal.write_text("a fit")
        raise ValueError("no end")

    monkeypatch.setattr("identification.diagnosis.diagnose.diagnose", searched)
    refused(furuta("diagnose", log, "-o", tmp_path / "found"), "no end")
    assert [path.name for path in tmp_path.iterdir()] == ["log.csv"]


def test_the_file_says_which_logs_it_is_of(tmp_path: Path) -> None:
    """By their hashes, the held-out ones apart; a file of an earlier version, without them, is still read."""
    names = {"searched.csv": False, "kept.csv": True}
    for i, name in enumerate(names):
        some_log(tmp_path / name, 400 + i, q1=np.zeros(400 + i))
    paths = [tmp_path / name for name in names]
    result = furuta("diagnose", paths[0], "--held-out", paths[1], "-o", tmp_path / "found")
    assert result.exit_code == 0, result.output
    written = json.loads((tmp_path / "found" / "diagnosis.json").read_text(encoding="utf-8"))
    hashes = [hashlib.sha256(path.read_bytes()).hexdigest() for path in paths]
    assert written["logs"] == [
        {"source": name, "sha256": digest, "held_out": held}
        for (name, held), digest in zip(names.items(), hashes, strict=True)
    ]
    del written["logs"]
    assert checked(written, DiagnosisFile).logs is UNSET
