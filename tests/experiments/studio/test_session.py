"""What a tab knows, without a page."""

from __future__ import annotations

import gc
import shlex
import shutil
import warnings
from dataclasses import replace
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

from experiments.studio import commands
from experiments.studio.remarks import heard
from experiments.studio.saved import open_session, save_session
from experiments.studio.session import Session, bare_name
from experiments.studio.written import write_mapping
from furuta_gym.plant import TABLE_3
from identification import LogError, LogWarning, RigMapping, load_mapping, read_log, read_logs, save_mapping, write_log
from tests.commands import furuta


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


def test_the_mapping_of_the_command_line_wins_over_the_file_beside_the_log(tmp_path: Path, spring_log: Path) -> None:
    path = two_logs(tmp_path, spring_log)[0]
    save_mapping(path.with_name("rig.toml"), RigMapping(flip=("q2",)), {}, "beside the log")
    beside, stated, none = (Session(tmp_path, said) for said in (None, RigMapping(flip=("u",)), RigMapping()))
    for session, turned in ((beside, ("q2",)), (stated, ("u",)), (none, None)):
        session.add(path)
        assert session.given.flip == turned
        session.remove(path)
        session.add(path)  # as at first
        assert session.given.flip == turned
        session.add(path, by_rig_file=False)
        assert session.given.flip == turned  # the logs that are open stay as they are read
        assert ("--mapping none" in commands.identify(session)) is (session is not beside)  # else rig.toml adds to it


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


def test_remarks_are_those_of_the_reading_alone(
    tmp_path: Path, spring_log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def read_beside_a_fit(*arguments: Any, **options: Any) -> Any:
        fit = Thread(target=lambda: warnings.warn("of a fit in another tab", LogWarning, stacklevel=1))
        fit.start()
        fit.join()
        warnings.warn("of this reading", LogWarning, stacklevel=1)
        warnings.warn("of a library", UserWarning, stacklevel=1)
        return read_logs(*arguments, **options)

    monkeypatch.setattr("experiments.studio.session.read_logs", read_beside_a_fit)
    with pytest.warns(LogWarning, match="of a fit in another tab") as told:  # it goes where it would go otherwise
        session = opened(tmp_path, spring_log)
    assert session.remarks == ("of this reading",)
    assert "of this reading" not in {str(w.message) for w in told}


def test_the_commands_shown_are_commands(tmp_path: Path, spring_log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    session = opened(tmp_path, spring_log)
    session.accept()
    for line in (commands.init(session),):
        result = furuta(*shlex.split(line)[1:])
        assert result.exit_code == 0, result.output
    for line in (commands.identify(session), commands.diagnose(session), commands.residuals(session)):
        assert furuta(*shlex.split(line)[1:], "--help").exit_code == 0  # its options are known before --help is seen
        with pytest.raises(AssertionError):
            assert furuta(*shlex.split(line)[1:], "--no-such-option").exit_code == 0


def test_how_logs_are_read_keeps_what_the_file_before_left_out(tmp_path: Path, spring_log: Path) -> None:
    session, path = opened(tmp_path, spring_log), tmp_path / "rig.toml"
    assert write_mapping(session, path) == ""
    assert write_mapping(session, path) == ""  # the same again
    shown = load_mapping(path)
    save_mapping(path, replace(shown, skip=1.0, cut=((2.0, 3.0),)))
    assert write_mapping(session, path) == f"{path}: kept from the file that was replaced: --skip 1 --cut 2:3."
    assert load_mapping(path) == replace(shown, skip=1.0, cut=((2.0, 3.0),))
    assert "kept from the file that was here" in path.read_text(encoding="utf-8")
    save_mapping(path, replace(shown, input_scale=0.5))
    assert write_mapping(session, path) == f"{path}: the file that was replaced said otherwise: --input-scale 0.5."
    path.write_text("no rig file")
    assert write_mapping(session, path) == ""
    assert load_mapping(path) == shown


@pytest.mark.parametrize("stated", [RigMapping(), RigMapping(skip=0.5)], ids=["none", "a file"])
def test_where_the_command_line_says_how_logs_are_read_the_file_before_adds_nothing(
    stated: RigMapping, tmp_path: Path, spring_log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    log, path = tmp_path / "log.csv", tmp_path / "rig.toml"
    shutil.copy(spring_log, log)
    left_out = RigMapping(skip=1.0, cut=((2.0, 3.0),))
    save_mapping(path, left_out)
    session = Session(tmp_path, stated)
    session.add(log)
    assert session.proposal is not None
    shown = session.proposal.mapping
    assert write_mapping(session, path) == f"{path}: the file that was replaced said otherwise: --skip 1 --cut 2:3."
    assert load_mapping(path) == shown
    assert (shown.skip, shown.cut) == (stated.skip, None)
    save_mapping(path, left_out)
    result = furuta(*shlex.split(commands.init(session))[1:])  # as the page shows it
    assert result.exit_code == 0, result.output
    assert load_mapping(path) == shown


def test_a_moved_plant_has_a_command_line_where_a_file_holds_it(tmp_path: Path, spring_log: Path) -> None:
    session, moved = opened(tmp_path, spring_log), TABLE_3.replace(theta=1.1 * TABLE_3.theta)
    assert commands.what_if(session, moved) == ""
    session.kept = moved
    assert commands.what_if(session, TABLE_3) == ""
    assert commands.what_if(session, moved).startswith("furuta validate what_if.json ")


def test_the_studio_computes_by_what_others_may_import_too() -> None:
    import ast

    import experiments.studio

    for path in Path(experiments.studio.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and not node.level:
                names = [*(node.module or "").split("."), *(alias.name for alias in node.names)]
                assert not [name for name in names if name.startswith("_") and name != "__future__"], path


@pytest.mark.parametrize("name", ["fits.jsonl", "paper.csv"])
def test_a_dropped_policy_takes_the_place_of_nothing(name: str, tmp_path: Path, spring_log: Path) -> None:
    session = Session(tmp_path)
    session.drop("paper.csv", spring_log.read_bytes())
    session.journal.write_text("a fit")
    session.take_policy(name, b"no policy")
    assert session.journal.read_text() == "a fit"
    assert session.paths[0].read_bytes() == spring_log.read_bytes()
    assert session.policy is not None
    assert session.policy.read_bytes() == b"no policy"
    assert not session.was_dropped(tmp_path / "paper.csv")
    assert session.was_dropped(session.paths[0])


def test_a_log_that_changes_or_vanishes_while_it_is_open_stays_what_was_read(tmp_path: Path, spring_log: Path) -> None:
    mine = tmp_path / "mine.csv"
    shutil.copy(spring_log, mine)
    session = opened(tmp_path, mine)
    digest = session.logs[0].sha256
    with open(mine, "a") as file:
        file.write("\n")
    session.turn("q2")
    session.turn("q2")
    assert session.logs[0].sha256 == digest == read_log(spring_log).sha256
    with pytest.raises(ValueError, match="has changed since it was opened"):
        save_session(session, tmp_path / "s.furuta")
    assert not (tmp_path / "s.furuta").exists()
    mine.unlink()
    session.turn("q2")  # needs no file
    assert len(session.logs) == 1


def test_what_is_heard_is_of_one_thread() -> None:
    def another() -> None:
        other = Thread(target=lambda: warnings.warn("another tab's", stacklevel=1))
        other.start()
        other.join()

    def both() -> dict[str, None]:
        with heard() as remarks:
            warnings.warn("mine", stacklevel=1)
            warnings.warn("mine", stacklevel=1)
            another()
        return remarks

    with pytest.warns(UserWarning, match="another tab"):
        assert list(both()) == ["mine"]


def test_what_an_export_warns_of_is_said_on_the_page(tmp_path: Path) -> None:
    from experiments.studio.views.export import _written

    def writer(path: Path) -> str:
        path.write_text("x")
        warnings.warn("was trained without input_delay", stacklevel=1)
        return "The plant has no limits"

    said = _written(Session(tmp_path), "policy.h", writer)
    assert said == "The plant has no limits. was trained without input_delay"
