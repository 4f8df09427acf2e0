"""What the views say while they wait, how it is stopped, and what they show where something cannot be had."""

from __future__ import annotations

import asyncio
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from experiments.studio.frame import Frame
from experiments.studio.session import Session
from experiments.studio.views import diagnose as diagnose_view
from experiments.studio.views import identify as identify_view
from experiments.studio.views import log as log_view
from experiments.studio.views import what_if as what_if_view
from experiments.studio.views.live import Live, _numbers
from experiments.studio.what_if import Choice
from experiments.studio.work import Job
from furuta_gym.plant import TABLE_3, Effect
from identification import Estimate
from tests.studio import known, texts, until, visit


def test_log_a_reading_that_takes_long_says_so_and_nothing_is_used_meanwhile(
    tmp_path: Path, spring_log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    turn, seen = Session.turn, threading.Event()

    def slowly(session: Session, axis: str) -> None:
        seen.wait(60.0)
        turn(session, axis)

    async def scenario(user: Any, frame: Any) -> None:
        monkeypatch.setattr(Session, "turn", slowly)
        user.find(marker="flip-q1").click()
        await until(lambda: "Reading the logs" in texts(user))
        assert not any(b.enabled for b in user.find("Use these logs").elements)
        user.find(marker="flip-q1").click()  # waits for its turn
        seen.set()
        await until(lambda: not frame.lock.locked())
        assert "Reading the logs" not in texts(user)
        assert not frame.failure
        assert "q1" not in (frame.session.given.flip or ())

    visit(scenario, tmp_path, [spring_log])


def test_log_a_reading_that_is_short_is_not_told(tmp_path: Path, spring_log: Path) -> None:
    shown: list[str] = []
    frame = Frame(Session(tmp_path))
    frame.show = lambda name=None: shown.append(frame.doing)  # type: ignore[method-assign]
    asyncio.run(log_view._apply(frame, lambda: None))
    assert shown == [""]


def test_log_a_sentence_names_the_button_and_no_option(tmp_path: Path, spring_log: Path) -> None:
    async def scenario(user: Any, frame: Any) -> None:
        user.find(marker="flip-q2").click()
        await until(lambda: "wrong" in texts(user))
        page = texts(user)
        assert "press “Read zero and signs as the motion shows them”." in page
        assert "read it with --" not in page

    visit(scenario, tmp_path, [spring_log])


def test_identify_calls_no_parameter_identified_that_may_be_shifted_much(
    tmp_path: Path, spring_log: Path, fitted: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Estimate, "uncertain", ["theta1"])

    async def scenario(user: Any, frame: Any) -> None:
        frame.show("Identify")
        page = " ".join(texts(user).split())
        assert "uncertain" in page[page.index("θ1") : page.index("θ2")]

    visit(scenario, tmp_path, [spring_log], known(fitted))


def test_a_fit_is_stopped_by_a_button(tmp_path: Path, spring_log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def endless(logs: Any, job: Any) -> None:
        while True:
            time.sleep(0.02)
            job.check()

    async def scenario(user: Any, frame: Any) -> None:
        frame.session.accept()
        monkeypatch.setattr(identify_view, "fit", endless)
        frame.show("Identify")
        user.find(marker="run-identify").click()
        await user.should_see(marker="stop", retries=40)
        user.find(marker="stop").click()
        await until(lambda: not frame.doing)
        await user.should_not_see(marker="stop")
        assert not frame.failure
        assert frame.session.estimate is None

    visit(scenario, tmp_path, [spring_log])


def test_diagnose_tells_no_file_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def goes_on(logs: Any, progress: Any, journal: Path, watch: Any) -> None:
        progress(f"{journal} keeps 1 fits of a search that was stopped; those of these logs are not made again")
        progress("identifying model (5)")

    monkeypatch.setattr(diagnose_view, "diagnose", goes_on)
    monkeypatch.setattr(diagnose_view, "examine", lambda found, logs, progress: found)
    job = Job()
    diagnose_view._diagnose([], job, tmp_path / "fits.jsonl", lambda tried: None)
    assert job.steps == ["what the search that was stopped has fitted is not fitted again", "identifying model (5)"]


def test_what_if_a_window_that_does_not_exist_leaves_the_one_that_is_shown(
    tmp_path: Path, spring_log: Path, fitted: Any
) -> None:
    async def scenario(user: Any, frame: Any) -> None:
        frame.show("What if")
        user.find("Start").click()
        live = frame.of(Live)
        await until(lambda: live.last is not None)
        start = live.start
        await what_if_view._window(frame, at=1000.0)
        assert "no window starts at 1000 s" in frame.failure
        assert (live.which, live.at) == (0, 0.0)
        assert live.start is start

    visit(scenario, tmp_path, [spring_log], known(fitted))


def test_what_if_no_number_of_another_plant_stays(tmp_path: Path, spring_log: Path, fitted: Any) -> None:
    async def scenario(user: Any, frame: Any) -> None:
        frame.show("What if")
        user.find("Start").click()
        live = frame.of(Live)
        await until(lambda: live.last is not None and "×" in live.ratio.text)
        box = next(iter(user.find(marker="number-theta1").elements))
        with user:
            box.set_value(1e-9)
        await until(lambda: live.ratio.text == "—")
        assert live.nats.text == "—"
        live.window = "the floor of an absurd plant"
        with user:
            user.find("Reset").click()
        await until(lambda: live.window is live.start.window)
        await until(lambda: "×" in live.ratio.text)
        box = next(iter(user.find(marker="number-theta1").elements))
        with user:
            box.set_value(None)
        user.find(marker="number-theta1").trigger("blur")
        await until(lambda: box.value == pytest.approx(fitted[0].plant.theta[0], rel=1e-4))
        assert live.choice.theta[0] == fitted[0].plant.theta[0]
        frame.note("Written: what_if.json")
        live.times.append(50.0)
        await _numbers(frame, live, live.window, live.window.picture(live.choice.plant(), settle=True))
        assert frame.footer.text == "Written: what_if.json"  # the times come again when the hand moves

    visit(scenario, tmp_path, [spring_log], known(fitted))


def test_what_if_sliders_reach_to_both_sides_of_a_fit_far_away() -> None:
    choice = Choice(TABLE_3)
    spring = TABLE_3.default_effect("arm_spring")
    far = 100.0 * spring.parameters["k"]
    choice.take(TABLE_3.replace(theta=100.0 * TABLE_3.theta).with_effects(Effect("arm_spring", {"k": far, "q1n": 0.0})))
    for i, value in enumerate(choice.theta):
        span = choice.theta_range(i)
        assert span.low < value < 0.5 * span.high
    (k,) = (p for p in spring.type.parameters if p.name == "k")
    assert choice.effect_range("arm_spring", k).high > 1.5 * far
    choice.reset()
    assert choice.theta_range(0).high == 4.0 * TABLE_3.theta[0]


def test_what_was_computed_is_saved_once_a_session_is_written(tmp_path: Path, spring_log: Path, fitted: Any) -> None:
    async def scenario(user: Any, frame: Any) -> None:
        assert not frame.saved
        frame.show("Export")
        user.find(marker="write-session.furuta").click()
        await until(lambda: frame.saved)
        frame.session.kept = TABLE_3
        assert not frame.saved
        await log_view.reopen(frame, "session.furuta", (tmp_path / "session.furuta").read_bytes())
        assert frame.session.estimate is not None
        assert frame.saved

    visit(scenario, tmp_path, [spring_log], known(fitted))
