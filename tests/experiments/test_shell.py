"""What belongs to no single command: version, completion, logging, the effects in words, and steps of long work."""

from __future__ import annotations

import io
import json
import logging
import time
from pathlib import Path

import pytest
from rich.console import Console
from typer.testing import CliRunner

from experiments.cli import app, output
from experiments.cli import steps as steps_module
from experiments.cli.logbook import own_version
from experiments.cli.steps import steps
from furuta_gym import cache_folder
from furuta_gym.cache_folder import note_compilation, when_compiling
from furuta_gym.plant import EFFECTS
from furuta_gym.plant.effects.library import CARRIED
from tests.commands import furuta, refused


def test_version() -> None:
    result = furuta("--version")
    assert result.exit_code == 0
    assert result.stdout.startswith(f"furuta-gym {own_version()} (Python 3.")


def test_completion_is_offered() -> None:
    assert "--install-completion" in furuta("--help").stdout


@pytest.mark.parametrize(("typed", "offered"), [("furuta dia", {"diagnose"}), ("furuta ex", {"excite", "export"})])
def test_completion_knows_the_commands(typed: str, offered: set[str]) -> None:
    shell = {"_FURUTA_COMPLETE": "complete_bash", "COMP_WORDS": typed, "COMP_CWORD": "1"}
    result = CliRunner().invoke(app, [], prog_name="furuta", env=shell)
    assert set(result.stdout.split()) == offered


def test_the_library_in_words() -> None:
    result = furuta("effects")
    assert result.exit_code == 0
    assert all(name in result.stdout for name in CARRIED)
    every = json.loads(furuta("effects", "--json").stdout)
    assert [e["name"] for e in every] == list(CARRIED)


@pytest.mark.parametrize("name", EFFECTS)
def test_one_effect_in_detail(name: str) -> None:
    text, kind = furuta("effects", name).stdout, EFFECTS[name]
    assert kind.equation in text
    assert kind.symptom in text
    assert all(p.meaning in text for p in kind.parameters)
    assert json.loads(furuta("effects", name, "--json").stdout)["equation"] == kind.equation


def test_a_wrong_name_is_told_with_what_is_near() -> None:
    refused(furuta("effects", "arm_sprng"), "did you mean arm_spring")


def test_a_record_is_kept_where_it_is_wanted(tmp_path: Path) -> None:
    file = tmp_path / "record.txt"
    result = furuta("--log-file", file, "validate", "qube", tmp_path / "absent.csv")
    assert result.exit_code == 2
    text = file.read_text(encoding="utf-8")
    assert "INFO furuta: furuta" in text
    assert "LogError" in text
    assert "INFO" not in result.stderr
    refused(furuta("--log-file", tmp_path / "no" / "folder", "effects"), "--log-file")
    _forget()


def test_v_says_what_is_done(tmp_path: Path) -> None:
    assert "INFO furuta: furuta" in furuta("-v", "effects").stderr
    _forget()
    assert furuta("effects").stderr == ""


def _forget() -> None:
    for name in ("furuta", "identification", "furuta_gym", "controllers", "experiments"):
        logger = logging.getLogger(name)
        for handler in list(logger.handlers):
            logger.removeHandler(handler)
            handler.close()
        logger.setLevel(logging.NOTSET)


@pytest.fixture
def notebook(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(steps_module, "_notebook", lambda: tmp_path / "pace.json")
    monkeypatch.setitem(steps_module.FIRST_TIME, "diagnose", (20.0, 5.0))
    return tmp_path / "pace.json"


def test_steps_are_lines_where_there_is_no_terminal(notebook: Path) -> None:
    out = io.StringIO()
    with steps("diagnose", 2000, Console(file=out)) as tell:
        tell("fitting [bold]")
        tell("looking")
    first, *others = out.getvalue().splitlines()
    assert first.startswith("furuta diagnose: about 30 s; where several effects are missing, ")
    assert others == ["[0 s] fitting [bold]", "[0 s] looking"]
    assert json.loads(notebook.read_text())["diagnose"] < 1e-2


def test_steps_are_one_line_with_the_time_on_a_terminal(notebook: Path) -> None:
    notebook.write_text(json.dumps({"diagnose": 130 / 30}))
    out = io.StringIO()
    with steps("diagnose", 2000, Console(file=out, force_terminal=True, width=80)) as tell:
        tell("fitting")
    assert "fitting …  0 s of about 2 min 10 s" in out.getvalue()


def test_a_step_after_other_work_shows_the_time_of_all() -> None:
    out = io.StringIO()
    with steps("demo", console=Console(file=out), began=time.monotonic() - 130.0) as tell:
        tell("2 of 6, fitting")
    assert out.getvalue() == "[2 min 10 s] 2 of 6, fitting\n"


def test_a_step_that_takes_longer_than_usual_says_so() -> None:
    line = steps_module._Line(time.monotonic() - 200.0, 130.0)
    line.text = "fitting"
    assert str(line.__rich__().text) == "fitting …  3 min 20 s, longer than the usual 2 min 10 s"


def test_counted_work_is_lines_where_there_is_no_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    out = io.StringIO()
    clock = iter(range(0, 1000, 2))
    monkeypatch.setattr(output, "errors", Console(file=out))
    monkeypatch.setattr(output.time, "monotonic", lambda: float(next(clock)))
    with output.counted("trials") as tell:
        for done in range(1, 21):
            tell(done, 20)
    lines = out.getvalue().splitlines()
    assert lines[0] == "[4 s] trials: 2 of 20"
    assert lines[-1] == "[40 s] trials: 20 of 20"
    assert 5 <= len(lines) <= 10


def test_counted_work_of_seconds_says_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    out = io.StringIO()
    monkeypatch.setattr(output, "errors", Console(file=out))
    with output.counted("trials") as tell:
        for done in range(1, 21):
            tell(done, 20)
    assert out.getvalue() == ""


@pytest.mark.parametrize("content", ["", "[]", '{"diagnose": "x"}', '{"diagnose": -1}', "{"])
def test_a_spoilt_notebook_does_not_matter(notebook: Path, content: str) -> None:
    notebook.write_text(content)
    out = io.StringIO()
    with steps("diagnose", 2000, Console(file=out)) as tell:
        tell("fitting")
    assert "about 30 s" in out.getvalue()


def test_a_short_log_says_what_a_long_one_takes(notebook: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Most of a short run is the same for every log: in proportion to samples, a long log would take for ever."""
    clock = iter([0.0, 60.0])
    monkeypatch.setattr(steps_module.time, "monotonic", lambda: next(clock))
    with steps("diagnose", 2000, Console(file=io.StringIO())):
        pass  # 60 s, where two idle cores take 20 s and 5 s for each of two thousand samples
    assert steps_module._expected("diagnose", 20_000) == pytest.approx(2.0 * (20.0 + 100.0))


def test_one_hard_log_moves_the_time_to_expect_half_way(notebook: Path) -> None:
    steps_module._remember("diagnose", 2000, 30.0)
    steps_module._remember("diagnose", 2000, 120.0)
    assert steps_module._expected("diagnose", 2000) == pytest.approx(60.0)


def test_a_run_that_compiled_is_not_remembered(notebook: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with steps("diagnose", 2000, Console(file=io.StringIO())):
        note_compilation()
    assert not notebook.exists()


def test_work_that_fails_is_not_remembered(notebook: Path) -> None:
    with pytest.raises(ValueError, match="broken"), steps("diagnose", 2000, Console(file=io.StringIO())):
        raise ValueError("broken")
    assert not notebook.exists()


@pytest.mark.parametrize(("seconds", "said"), [(8, "8 s"), (130, "2 min 10 s"), (120, "2 min"), (3900, "1 h 5 min")])
def test_times_as_people_say_them(seconds: float, said: str) -> None:
    assert steps_module.short(seconds) == said


def test_in_python_the_log_says_why_it_takes_long(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    heard = []
    monkeypatch.setattr(cache_folder, "_compiled", 0)
    with when_compiling(lambda: heard.append(1)):
        note_compilation()
    assert (heard, caplog.messages) == ([1], [])
    monkeypatch.setattr(cache_folder, "_compiled", 0)
    note_compilation()
    note_compilation()
    (message,) = caplog.messages
    assert "compiling for this machine, once" in message
