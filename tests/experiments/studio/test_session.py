"""What a tab knows, without a page."""

from __future__ import annotations

import gc
import warnings
from pathlib import Path
from threading import Thread

import pytest

from experiments.studio.remarks import heard
from experiments.studio.saved import open_session, save_session
from experiments.studio.session import Session, bare_name
from identification import LogError, read_log, write_log


def opened(folder: Path, log: Path) -> Session:
    session = Session(folder)
    session.add(log)
    return session


def test_a_turned_sign_is_wrong_and_the_motion_mends_it(tmp_path: Path, spring_log: Path) -> None:
    session = opened(tmp_path, spring_log)
    assert session.shown_by_motion() is None
    straight = session.logs[0].q2
    session.turn("q2")
    assert (session.logs[0].q2 == -straight).all()  # the preview flips
    with pytest.raises(LogError, match="settle what is red"):
        session.accept()
    better = session.shown_by_motion()
    assert better is not None
    session.mend(better)
    session.accept()
    assert (session.logs[0].q2 == straight).all()


def test_what_the_motion_shows_is_worked_out_when_the_logs_are_read(
    tmp_path: Path, spring_log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    session = opened(tmp_path, spring_log)
    session.turn("q2")
    monkeypatch.setattr("experiments.studio.session.propose", None)  # views ask often, and it takes seconds
    assert session.shown_by_motion() is not None


@pytest.mark.parametrize("name", ["../../etc/passwd.csv", "..\\..\\boot.csv", "/etc/passwd.csv", "a/b/../c.csv"])
def test_no_name_leads_out_of_the_folder(tmp_path: Path, name: str) -> None:
    assert bare_name(name) in ("passwd.csv", "boot.csv", "c.csv")
    with pytest.raises(ValueError, match="bare name"):
        Session(tmp_path).target(name)


def test_a_dropped_file_is_read_by_the_same_reader_and_deleted(tmp_path: Path, spring_log: Path) -> None:
    session = Session(tmp_path)
    session.drop("../../outside.csv", spring_log.read_bytes())
    path = session.paths[0]
    assert path.name == "outside.csv"
    assert (session.logs[0].q1 == read_log(spring_log).q1).all()
    session.close()
    assert not path.exists()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("content", [b"", b"\x00\x01\x02", b"t,q1,q2,u\n1,2,3\n"])
def test_what_is_no_log_is_refused_and_leaves_nothing(tmp_path: Path, spring_log: Path, content: bytes) -> None:
    session = opened(tmp_path, spring_log)
    with pytest.raises(LogError):
        session.drop("broken.csv", content)
    assert [path.name for path in session.paths] == ["spring.csv"]
    assert session.logs


@pytest.mark.parametrize("content", [b"", b"\x00\x01\x02", b"t,q1,q2,u\n1,2,3\n"])
def test_what_is_no_log_does_not_take_the_place_of_a_log_of_its_name(
    tmp_path: Path, spring_log: Path, content: bytes
) -> None:
    session = Session(tmp_path)
    session.drop("spring.csv", spring_log.read_bytes())
    with pytest.raises(LogError):
        session.drop("spring.csv", content)
    (path,) = session.paths
    assert path.read_bytes() == spring_log.read_bytes()
    assert session.logs


def test_a_file_that_is_too_large_is_refused(tmp_path: Path, spring_log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("experiments.studio.session.LARGEST_FILE", 1000)
    with pytest.raises(LogError, match="at most 1000"):
        Session(tmp_path).drop("large.csv", spring_log.read_bytes())


def test_what_was_dropped_goes_with_its_session_also_where_nobody_closes_it(tmp_path: Path, spring_log: Path) -> None:
    session = Session(tmp_path)
    session.drop("spring.csv", spring_log.read_bytes())
    (path,) = session.paths
    assert session.was_dropped(path)
    assert not session.was_dropped(spring_log)
    assert path.parent.stat().st_mode & 0o777 == 0o700
    del session
    gc.collect()
    assert not path.parent.exists()


def two_logs(folder: Path, log: Path) -> list[Path]:
    """Two logs of one file name, the second one shorter."""
    paths = [folder / run / "log.csv" for run in ("run1", "run2")]
    for path, stop in zip(paths, (6.0, 5.0), strict=True):
        path.parent.mkdir()
        write_log(path, read_log(log).slice(stop=stop))
    return paths


def test_logs_of_one_file_name_are_told_apart(tmp_path: Path, spring_log: Path) -> None:
    paths = two_logs(tmp_path, spring_log)
    session = Session(tmp_path)
    for path in paths:
        session.add(path)
    assert session.paths == paths
    assert session.names == [log.source for log in session.logs] == ["run1/log.csv", "run2/log.csv"]
    assert [round(log.duration) for log in session.logs] == [6, 5]
    session.add(paths[1])  # read again
    assert session.paths == paths
    again = open_session("s.furuta", save_session(session, tmp_path / "s.furuta").read_bytes(), tmp_path)
    assert again.names == ["run1-log.csv", "run2-log.csv"]
    assert [round(log.duration) for log in again.logs] == [6, 5]
    session.remove(paths[0])
    assert session.paths == paths[1:]
    assert session.names == [session.logs[0].source] == ["log.csv"]
    again.close()


def test_a_dropped_log_takes_the_place_of_none_of_its_name(tmp_path: Path, spring_log: Path) -> None:
    paths = two_logs(tmp_path, spring_log)
    session = Session(tmp_path)
    session.add(paths[0])
    session.drop("log.csv", paths[1].read_bytes())
    assert session.names == ["log.csv", "log-2.csv"]
    assert [round(log.duration) for log in session.logs] == [6, 5]
    for path in paths:
        with pytest.raises(LogError, match=r"log\.csv: this log is open already, as log"):
            session.drop("log.csv", path.read_bytes())
    assert session.names == ["log.csv", "log-2.csv"]
    session.close()


def test_remarks_are_those_of_one_thread() -> None:
    def another() -> None:
        other = Thread(target=lambda: warnings.warn("another tab's", stacklevel=1))
        other.start()
        other.join()

    with heard() as remarks:
        warnings.warn("mine", stacklevel=1)
        warnings.warn("mine", stacklevel=1)
        with pytest.warns(UserWarning, match="another tab"):
            another()
    assert list(remarks) == ["mine"]


def test_what_an_export_warns_of_is_said_on_the_page(tmp_path: Path) -> None:
    def writer(path: Path) -> str:
        path.write_text("x")
        warnings.warn("was trained without input_delay", stacklevel=1)
        return "The plant has no limits"

    from experiments.studio.views.export import _written

    said = _written(Session(tmp_path), "policy.h", writer)
    assert said == "The plant has no limits. was trained without input_delay"
