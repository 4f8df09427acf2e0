"""What the studio keeps, what it tells beforehand that it forgets, and what a replaced file said."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from experiments.studio.saved import open_session
from experiments.studio.views import what_if as what_if_view
from furuta_gym.plant import TABLE_3, Plant
from identification import RigMapping, save_mapping
from tests.studio import known, texts, visit


def test_log_says_what_goes_with_another_log(tmp_path: Path, spring_log: Path, fitted: Any) -> None:
    async def scenario(user: Any, frame: Any) -> None:
        await user.should_see("With another log, session or reading, this page forgets the fit and the kept plant.")
        user.find(marker="flip-q2").click()
        await user.should_see("wrong", retries=40)
        assert "this page forgets" not in texts(user)

    def prepare(frame: Any) -> None:
        known(fitted)(frame)
        frame.session.kept = TABLE_3
        frame.show()

    visit(scenario, tmp_path, [spring_log], prepare)


def test_identify_and_export_say_what_went_with_the_file_that_was_replaced(
    tmp_path: Path, spring_log: Path, fitted: Any
) -> None:
    lost = "rig.json: the file that is replaced had the rig's limits (arm_travel 2); the new one has none"
    limited = TABLE_3.replace(limits={"arm_travel": 2.0})

    async def scenario(user: Any, frame: Any) -> None:
        limited.save(tmp_path / "rig.json")
        frame.show("Identify")
        user.find("Save rig.json").click()
        await user.should_see(lost)
        user.find("Save rig.json").click()
        await user.should_not_see(lost)
        limited.save(tmp_path / "rig.json")
        save_mapping(tmp_path / "rig.toml", RigMapping(skip=1.0))
        frame.show("Export")
        user.find(marker="write-rig.json").click()
        await user.should_see(lost, retries=20)
        assert Plant.load(tmp_path / "rig.json").theta[0] == fitted[0].plant.theta[0]
        user.find(marker="write-rig.toml").click()
        await user.should_see("rig.toml: kept from the file that was replaced: --skip 1.", retries=20)

    visit(scenario, tmp_path, [spring_log], known(fitted))


def test_identify_calls_no_sharpness_weak(tmp_path: Path, spring_log: Path, fitted: Any) -> None:
    estimate, gap = fitted
    r = next(name for name in estimate.names if name.startswith("r"))
    blunt = replace(estimate.identifiability, relative_std={**estimate.identifiability.relative_std, r: 0.7})

    async def scenario(user: Any, frame: Any) -> None:
        frame.show("Identify")
        assert "% not judged" in " ".join(texts(user).split())

    visit(scenario, tmp_path, [spring_log], known((replace(estimate, identifiability=blunt), gap)))


def test_what_if_goes_back_to_the_fit_also_from_a_plant_that_was_kept_before(
    tmp_path: Path, session_file: Path, fitted: Any, with_spring: Plant
) -> None:
    session = open_session("spring.furuta", session_file.read_bytes(), tmp_path)
    choice = what_if_view.choice_of(session)
    assert choice.plant() == with_spring
    choice.reset()
    assert choice.plant() == fitted[0].plant
    session.close()
