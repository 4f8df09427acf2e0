"""Every view as a user meets it, without a browser."""

from __future__ import annotations

import asyncio
import io
import math
import time
import zipfile
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from experiments.studio.frame import Frame
from experiments.studio.saved import open_session
from experiments.studio.session import Session
from experiments.studio.views import diagnose as diagnose_view
from experiments.studio.views import identify as identify_view
from experiments.studio.views import log as log_view
from experiments.studio.views.closed_loop import Playing, _offered
from experiments.studio.views.live import Live
from experiments.studio.views.play import Kind
from furuta_gym.plant import TABLE_3, Plant
from identification import LogError, RigMapping, save_mapping
from identification.diagnosis.watched import Tried
from tests.studio import known, texts, until, visit


def test_log_a_wrong_sign_shows_red_and_the_fix_turns_it_green(tmp_path: Path, spring_log: Path) -> None:
    async def scenario(user: Any, frame: Any) -> None:
        await user.should_see("How it is read")
        await user.should_not_see("wrong")
        user.find(marker="flip-q2").click()
        await user.should_see("wrong", retries=40)
        await until(lambda: not frame.doing)  # until then its buttons are off
        shown = user.find(marker="preview").elements.pop().options["series"][1]["data"]
        assert shown[10][1] == pytest.approx(frame.session.logs[0].q2[:: _every(frame)][10], rel=1e-4)
        user.find(marker="by-motion").click()
        await until(lambda: "wrong" not in texts(user))
        back = user.find(marker="preview").elements.pop().options["series"][1]["data"]
        assert back[10][1] == -shown[10][1]
        user.find("Use these logs").click()
        await until(lambda: frame.current == "Identify")
        assert frame.session.accepted

    visit(scenario, tmp_path, [spring_log])


def test_a_fit_of_logs_that_changed_meanwhile_is_not_kept(
    tmp_path: Path, spring_log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    frame = Frame(Session(tmp_path))
    frame.session.add(spring_log)

    def fit(logs: Any, job: Any) -> tuple[str, None, str]:
        frame.session.turn("u")
        return "of the logs before", None, ""

    monkeypatch.setattr(identify_view, "fit", fit)
    asyncio.run(identify_view.run(frame))
    assert frame.session.estimate is None
    assert "changed while they were fitted" in frame.failure


def _every(frame: Any) -> int:
    return -(-len(frame.session.logs[0]) // 700)


def test_log_a_dropped_file_that_is_none_is_a_sentence_and_the_page_lives(tmp_path: Path, spring_log: Path) -> None:
    async def scenario(user: Any, frame: Any) -> None:
        from nicegui import ui
        from nicegui.elements.upload_files import SmallFileUpload

        async def drop(name: str, data: bytes) -> None:
            with user:
                upload = next(iter(user.find(ui.upload).elements))
                await upload.handle_uploads([SmallFileUpload(name, "text/csv", data)])

        await drop("noise.csv", b"\x00\x01\x02")
        await user.should_see("noise.csv", retries=20)
        assert frame.failure
        await drop("spring.csv", spring_log.read_bytes())
        await user.should_see("How it is read", retries=40)
        assert not frame.failure

    visit(scenario, tmp_path)


def test_log_the_demo_is_not_read_by_the_rig_file_of_the_user(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    save_mapping(tmp_path / "rig.toml", RigMapping(t="Time", q1="arm", q2="pendulum", u="volts", unit_q1="deg"))

    async def scenario(user: Any, frame: Any) -> None:
        user.find("Open the demo's log").click()
        await until(lambda: frame.session.logs, 20.0)
        assert frame.session.given.empty

    visit(scenario, tmp_path)


def test_log_what_is_wrong_with_one_of_several_files_is_said(tmp_path: Path, spring_log: Path) -> None:
    wrong = tmp_path / "wrong.csv"
    wrong.write_bytes(b"")
    frame = Frame(Session(tmp_path))
    asyncio.run(log_view.add(frame, [wrong, spring_log]))
    assert "wrong.csv" in frame.failure
    assert frame.session.paths == [spring_log]


def test_tabs_do_not_disturb_each_other(tmp_path: Path, spring_log: Path) -> None:
    async def scenario(user: Any, frame: Any) -> None:
        first = frame.session
        other = type(user)(user.http_client)
        await other.open("/")
        await other.should_see("How it is read", retries=60)
        user.find(marker="flip-q2").click()
        await user.should_see("wrong", retries=40)
        assert first.given.flip
        assert "wrong" not in texts(other)

    visit(scenario, tmp_path, [spring_log])


def test_identify_says_first_whether_the_model_is_adequate(tmp_path: Path, spring_log: Path, fitted: Any) -> None:
    async def scenario(user: Any, frame: Any) -> None:
        frame.show("Identify")
        page = texts(user)
        assert page.index("Is the model adequate?") < page.index("Parameters")
        assert f"{fitted[1].ratio_to_floor:.3g} ×" in page
        assert "not adequate" in page  # the spring is missing
        assert "θ8" in page
        assert "furuta identify" in page
        user.find("Save rig.json").click()
        assert (tmp_path / "rig.json").is_file()

    visit(scenario, tmp_path, [spring_log], known(fitted))


@pytest.mark.parametrize("error", [LogError("the log is too short"), RuntimeError("a bug"), MemoryError()])
def test_a_computation_that_fails_is_a_sentence(
    tmp_path: Path, spring_log: Path, monkeypatch: pytest.MonkeyPatch, error: BaseException
) -> None:
    def fail(logs: Any, job: Any) -> None:
        raise error

    async def scenario(user: Any, frame: Any) -> None:
        frame.session.accept()
        monkeypatch.setattr(identify_view, "fit", fail)
        frame.show("Identify")
        user.find(marker="run-identify").click()
        await until(lambda: frame.failure)
        await user.should_see(str(error) or "MemoryError")
        frame.show("Log")
        await user.should_see("How it is read")

    visit(scenario, tmp_path, [spring_log])


def test_what_if_moves_at_once_and_the_hidden_effect_brings_the_error_to_the_floor(
    tmp_path: Path, spring_log: Path, fitted: Any
) -> None:
    async def scenario(user: Any, frame: Any) -> None:
        frame.show("What if")
        user.find("Start").click()
        live = frame.of(Live)
        await until(lambda: live.last is not None)
        before = live.last.ratio_to_floor
        seen = live.last.angles.copy()
        number(user, "theta1", live.choice.theta[0] * 1.3)
        await until(lambda: not np.array_equal(live.last.angles, seen, equal_nan=True))
        user.find("Reset").click()
        await until(lambda: live.choice.theta[0] == live.choice.base.theta[0])
        live.choice.add("arm_spring")
        frame.show()
        user.find("Fit this one").click()
        await until(lambda: frame.doing)
        await until(lambda: not frame.doing)
        await until(lambda: live.last.ratio_to_floor < 1.2, 60)
        assert before > 2.0
        assert live.choice.effects["arm_spring"]["k"] == pytest.approx(0.12, rel=0.2)
        fitted_size = live.choice.effects["arm_spring"]["k"]
        number(user, "arm_spring.k", 0.0)
        await until(lambda: live.last.ratio_to_floor > 2.0)
        number(user, "arm_spring.k", fitted_size)
        await until(lambda: live.last.ratio_to_floor < 1.3)
        user.find("Keep as plant").click()
        assert (tmp_path / "what_if.json").is_file()
        assert "furuta validate what_if.json" in texts(user)
        number(user, "theta6", 1.4 * live.choice.theta[5])
        await until(lambda: "The same on the command line" not in texts(user))  # no file holds this plant
        user.find("Keep as plant").click()
        frame.show("Export")
        assert "the plant that was moved by hand in What if (θ6); it is no fit and has no error bars" in texts(user)
        user.find(marker="write-plant.json").click()
        await until((tmp_path / "plant.json").is_file)
        assert Plant.load(tmp_path / "plant.json").provenance["moved"].keys() == {"theta6"}

    visit(scenario, tmp_path, [spring_log], known(fitted))


def test_what_if_whoever_goes_elsewhere_while_it_starts_stays_there(
    tmp_path: Path, spring_log: Path, fitted: Any
) -> None:
    async def scenario(user: Any, frame: Any) -> None:
        frame.show("What if")
        user.find("Start").click()
        await until(lambda: frame.doing)
        frame.show("Export")
        await until(lambda: frame.of(Live).start is not None)
        await until(lambda: not frame.doing)
        await asyncio.sleep(0.5)
        assert frame.current == "Export"

    visit(scenario, tmp_path, [spring_log], known(fitted))


def number(user: Any, mark: str, value: float) -> None:
    """Type a number beside a slider."""
    with user:
        next(iter(user.find(marker=f"number-{mark}").elements)).set_value(value)


def test_what_if_an_impossible_plant_is_a_sentence(tmp_path: Path, spring_log: Path, fitted: Any) -> None:
    async def scenario(user: Any, frame: Any) -> None:
        frame.show("What if")
        user.find("Start").click()
        live = frame.of(Live)
        await until(lambda: live.last is not None)
        number(user, "theta1", 1e-9)
        await user.should_see("mass matrix", retries=40)
        frame.show("Play")
        await user.should_see("Left: measured")
        await user.should_see("mass matrix")
        frame.show("What if")
        user.find("Reset").click()
        await until(lambda: "mass matrix" not in texts(user))
        assert math.isfinite(live.last.ratio_to_floor)

    visit(scenario, tmp_path, [spring_log], known(fitted))


def test_diagnose_shows_its_steps_and_what_each_explains_and_keeps_it_when_stopped(
    tmp_path: Path, spring_log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def endless(logs: Any, progress: Any, journal: Path, watch: Any) -> None:
        journal.write_text("{}\n")
        progress("fitting arm_spring, base_tilt, arm_ripple")
        watch(Tried(TABLE_3, 100.0, False))
        watch(Tried(TABLE_3.with_effects(TABLE_3.default_effect("arm_spring")), 300.0, True))
        watch(Tried(TABLE_3.with_effects(TABLE_3.default_effect("base_tilt")), 150.0, True))
        progress("fitting arm_spring to the end")
        while True:
            time.sleep(0.02)
            watch(Tried(TABLE_3, 100.0, False))

    async def scenario(user: Any, frame: Any) -> None:
        frame.session.accept()
        monkeypatch.setattr(diagnose_view, "diagnose", endless)
        frame.show("Diagnose")
        user.find(marker="run-diagnose").click()
        await user.should_see("being fitted", retries=40)
        user.find("Stop and keep what is known").click()
        await user.should_see("Stopped. This is what was known", retries=40)
        page = " ".join(texts(user).split())
        assert "(arm_spring) +200" in page
        assert "(base_tilt) +50" in page
        assert "out: 150 nats behind" in page
        assert "fitting arm_spring, base_tilt, arm_ripple" in page
        assert not frame.doing
        await user.should_see("Go on")

    visit(scenario, tmp_path, [spring_log])


def test_diagnose_ends_with_the_name_in_physical_words(
    tmp_path: Path, spring_log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from identification import diagnose

    asked: list[dict[str, Any]] = []

    def small(logs: Any, **options: Any) -> Any:
        asked.append(options)
        return diagnose(logs, most=1, only=["arm_spring", "arm_quadratic_drag"], **options)

    async def scenario(user: Any, frame: Any) -> None:
        frame.session.accept()
        monkeypatch.setattr(diagnose_view, "diagnose", small)
        frame.show("Diagnose")
        user.find(marker="run-diagnose").click()
        await until(lambda: frame.session.examination is not None, 180)
        await user.should_see("A cable pulls the arm", retries=20)
        assert frame.session.journal.exists()
        frame.show("Export")
        await user.should_see("report.html")
        user.find(marker="write-plant.json").click()
        await until((tmp_path / "plant.json").is_file)
        assert "arm_spring" in (tmp_path / "plant.json").read_text()
        user.find(marker="write-session.furuta").click()
        await until((tmp_path / "session.furuta").is_file)
        again = open_session("s.furuta", (tmp_path / "session.furuta").read_bytes(), tmp_path)
        assert again.found == frame.session.found
        assert again.journal.read_text() == frame.session.journal.read_text()
        frame.session, _ = again, frame.session.close()
        frame.show("Export")
        await user.should_not_see("report.html")
        await user.should_see("press “Search again” in the view Diagnose, or run: furuta diagnose spring.csv")

    visit(scenario, tmp_path, [spring_log])
    assert "most" not in asked[0]  # how many effects are looked for is decided where the command line has it from


def test_residuals_follow_the_stretch_and_name_nothing(tmp_path: Path, spring_log: Path, fitted: Any) -> None:
    from furuta_gym.plant import EFFECTS

    async def scenario(user: Any, frame: Any) -> None:
        frame.show("Residuals")
        user.find("Show what is missing").click()
        await user.should_see("Missing torque over time", retries=200)
        whole = len(next(iter(user.find(marker="against").elements)).options["series"][0]["data"])
        from nicegui import ui

        with user:
            next(iter(user.find(ui.range).elements)).set_value({"min": 1.0, "max": 2.0})
        await until(
            lambda: len(next(iter(user.find(marker="against").elements)).options["series"][0]["data"]) < whole / 3
        )
        page = texts(user)
        assert not [name for name, kind in EFFECTS.items() if name in page or kind.title in page]

    visit(scenario, tmp_path, [spring_log], known(fitted))


def test_play_and_export_wait_for_what_they_need(tmp_path: Path, spring_log: Path, fitted: Any) -> None:
    async def scenario(user: Any, frame: Any) -> None:
        frame.show("Play")
        await user.should_see("First start the view What if")
        frame.show("Export")
        await user.should_see("rig.json")
        await user.should_not_see("report.html")
        user.find(marker="write-session.sh").click()
        await until((tmp_path / "session.sh").is_file)
        assert "furuta identify" in (tmp_path / "session.sh").read_text()
        live = frame.of(Live)
        live.window = SimpleNamespace(log=frame.session.logs[0])
        live.last = SimpleNamespace(angles=frame.session.logs[0].angles * np.nan)
        live.choice = SimpleNamespace(plant=lambda: TABLE_3)
        frame.show("Play")
        await asyncio.sleep(0.2)
        assert " s" in next(iter(user.find(marker="clock").elements)).text

    visit(scenario, tmp_path, [spring_log], known(fitted))


def test_play_offers_policies_and_warns_before_a_foreign_one_is_read(
    tmp_path: Path, spring_log: Path, fitted: Any
) -> None:
    async def scenario(user: Any, frame: Any) -> None:
        raw = io.BytesIO()
        with zipfile.ZipFile(raw, "w") as archive:
            archive.writestr("data", "{}")  # as stable-baselines3 names what it pickles
        frame.session.take_policy("../foreign.zip", raw.getvalue())
        frame.of(Kind).name = "Closed loop"
        frame.of(Playing).name = str(frame.session.policy)
        frame.show("Play")
        await user.should_see("runs any code that is in it")
        user.find(marker="play").click()
        await until(lambda: frame.failure)
        assert "--trust" in frame.failure
        assert frame.of(Playing).loop is None
        assert not frame.session.trusted
        policy = next(name for name in _offered(frame) if name.endswith("balance-table3.zip"))
        frame.session.take_policy("balance.zip", Path(policy).read_bytes())
        frame.failure = ""
        frame.show("Export")
        user.find(marker="write-policy.onnx").click()
        await until((tmp_path / "policy.onnx").is_file)
        user.find(marker="write-policy.h").click()
        await until((tmp_path / "policy.h").is_file)
        assert "furuta export rig.json balance.zip -o policy.onnx" in texts(user)

    visit(scenario, tmp_path, [spring_log], known(fitted))
