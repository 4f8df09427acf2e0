"""A session as one file: what was known is known again, and a file that was made otherwise is refused."""

from __future__ import annotations

import io
import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.studio import LARGEST_FILE
from experiments.studio.saved import open_session, save_session
from experiments.studio.session import Session
from furuta_gym.plant import Plant
from identification import LogError


def test_what_was_known_is_known_again(session_file: Path, fitted: Any, with_spring: Plant, tmp_path: Path) -> None:
    estimate, gap = fitted
    again = open_session("spring.furuta", session_file.read_bytes(), tmp_path)
    assert again.accepted
    assert again.estimate is not None
    assert str(again.estimate) == str(estimate)
    np.testing.assert_array_equal(again.estimate.covariance, estimate.covariance)
    assert again.gap is not None
    assert again.gap.to_dict() == gap.to_dict()
    assert again.gap.verdict == gap.verdict
    assert again.kept is not None
    assert again.kept.to_dict() == with_spring.to_dict()
    assert again.logs[0].sha256 is not None
    assert list(tmp_path.iterdir()) == []  # the working folder is left alone
    again.close()


def test_a_session_without_a_fit_and_with_a_turned_sign(spring_log: Path, tmp_path: Path) -> None:
    session = Session(tmp_path)
    session.add(spring_log)
    session.turn("q1")
    path = save_session(session, tmp_path / "s.furuta")
    again = open_session("s.furuta", path.read_bytes(), tmp_path)
    assert not again.accepted
    assert again.estimate is None
    np.testing.assert_array_equal(again.logs[0].q1, session.logs[0].q1)
    again.close()


def test_the_search_goes_on_from_its_fits(spring_log: Path, tmp_path: Path) -> None:
    session = Session(tmp_path)
    session.add(spring_log)
    session.accept()
    session.journal.write_text('{"fit": "x"}\n')
    again = open_session("s.furuta", save_session(session, tmp_path / "s.furuta").read_bytes(), tmp_path)
    assert again.journal.read_text() == '{"fit": "x"}\n'
    again.turn("q1")  # other logs now
    assert not again.journal.exists()
    session.close()
    again.close()


def members(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def packed(contents: dict[str, bytes]) -> bytes:
    raw = io.BytesIO()
    with zipfile.ZipFile(raw, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in contents.items():
            archive.writestr(name, data)
    return raw.getvalue()


def put(data: Any, keys: list[Any], value: Any) -> None:
    for key in keys[:-1]:
        data = data[key]
    if value is None:
        del data[keys[-1]]
    else:
        data[keys[-1]] = value


@pytest.mark.parametrize(
    ("keys", "value", "said"),
    [
        (["schema"], "furuta-session/2", "furuta-session/1"),
        (["accepted"], "yes", "expected bool"),
        (["accepted"], None, "accepted"),
        (["more"], 1, "more"),
        (["given", "skip"], -1.0, "skip"),
        (["given", "flip"], ["q9"], "q9"),
        (["estimate", "covariance"], [[1.0]], "another size"),
        (["estimate", "values"], ["__import__('os')"], "expected a number"),
        (["estimate", "values", 0], True, "expected a number"),
        (["estimate", "plant", "theta", "theta1"], "1", "theta"),
        (["gap", "rms"], [1.0, 2.0, 3.0], "pairs"),
        (["gap", "errors"], [[1.0], [1.0, 2.0]], "inhomogeneous"),
        (["kept", "schema"], "furuta-plant/9", "furuta-plant/1"),
        (["logs", 0, "sha256"], "0", "missing or changed"),
        (["logs", 0, "name"], "../../x.csv", "missing or changed"),
    ],
)
def test_what_does_not_fit_its_types_is_refused(
    session_file: Path, tmp_path: Path, keys: list[Any], value: Any, said: str
) -> None:
    contents = members(session_file)
    record = json.loads(contents["session.json"])
    put(record, keys, value)
    contents["session.json"] = json.dumps(record).encode()
    with pytest.raises(LogError, match=r"x\.furuta: cannot be read as a session") as refused:
        open_session("x.furuta", packed(contents), tmp_path)
    assert said in str(refused.value)
    assert list(tmp_path.iterdir()) == []


def test_broken_files_are_refused(session_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = session_file.read_bytes()
    contents = members(session_file)
    for content in (b"", b"no zip", whole[: len(whole) // 2], packed({"logs/a.csv": b"t"})):
        with pytest.raises(LogError, match="cannot be read as a session"):
            open_session("x.furuta", content, tmp_path)
    with pytest.raises(LogError, match="belongs to no session"):
        open_session("x.furuta", packed(contents | {"run.py": b"print()"}), tmp_path)
    with pytest.raises(LogError, match="at most"):
        open_session("x.furuta", packed(contents | {f"logs/{i}.csv": b"" for i in range(20)}), tmp_path)
    monkeypatch.setattr("experiments.studio.saved.LARGEST_FILE", 1000)
    with pytest.raises(LogError, match="expected at most 1000"):
        open_session("x.furuta", whole, tmp_path)


def test_a_file_that_unpacks_to_too_much_is_refused(
    session_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    zeros = packed(members(session_file) | {"fits.jsonl": bytes(LARGEST_FILE // 2)})
    assert len(zeros) < LARGEST_FILE / 100
    monkeypatch.setattr("experiments.studio.saved.LARGEST_FILE", 1_000_000)  # and what its journal may add
    with pytest.raises(LogError, match="unpacked it is larger"):
        open_session("x.furuta", zeros, tmp_path)


def test_logs_that_could_not_be_opened_again_are_not_saved(
    spring_log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    session = Session(tmp_path)
    session.add(spring_log)
    monkeypatch.setattr("experiments.studio.saved.LARGEST_FILE", 1000)
    with pytest.raises(ValueError, match="larger than 1000 bytes"):
        save_session(session, tmp_path / "s.furuta")
    assert list(tmp_path.iterdir()) == []
