"""The experiment that a diagnosis designs where it cannot tell."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from experiments.report import advice
from furuta_gym.plant import Plant
from identification.diagnosis.naming.found import FoundEffect
from identification.logs.log import Log
from tests.identification.diagnosis.fits import suspect

PLANT = Plant.resolve("table3")
NAMES = ("input_delay", "actuator_lag", "input_dead_zone", "arm_backlash")


def diagnosis(equals: tuple[tuple[str, ...], ...]) -> Any:
    """One that has named the first effect, then the third."""

    def suspect(name: str) -> Any:
        effect = PLANT.default_effect(name)
        return SimpleNamespace(name=name, fit=SimpleNamespace(plant=PLANT.with_effects(effect)))

    ranking = [suspect(name) for name in NAMES]
    named = zip((ranking[0], ranking[2]), equals, strict=True)
    found = [FoundEffect((first, *(s for s in ranking if s is not first)), names) for first, names in named]
    return SimpleNamespace(naming=SimpleNamespace(found=found), after=SimpleNamespace(plant=PLANT))


def log(q2: float) -> Log:
    t = np.arange(100) * 0.004
    return Log(t, 0.0 * t, q2 + 0.01 * np.sin(t), np.cos(t), "N·m")


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """What `between` was asked."""
    calls: list[Any] = []
    monkeypatch.setattr(advice, "between", lambda *a, **k: calls.append((*a, k)) or "designed")
    return calls


@pytest.mark.parametrize(("q2", "balances"), [(0.0, True), (2 * np.pi, True), (np.pi, False)])
def test_equals_are_asked_about_as_fitted_in_the_loop_of_the_logs(q2: float, balances: bool, asked: list[Any]) -> None:
    found = advice.design_next(diagnosis((("actuator_lag", "input_dead_zone", "arm_backlash"), ())), [log(q2)])
    assert found == "designed"
    plant, effects, policy, more = asked[0]
    assert plant is PLANT
    assert [e.name for e in effects] == ["input_delay", "actuator_lag", "input_dead_zone"]
    assert effects[0] == PLANT.default_effect("input_delay")
    assert (policy is not None) == balances
    assert more["sample_time"] == pytest.approx(0.004)


def test_the_first_set_of_equals_counts(asked: list[Any]) -> None:
    advice.design_next(diagnosis(((), ("arm_backlash",))), [log(0.0)])
    assert [e.name for e in asked[0][1]] == ["input_dead_zone", "arm_backlash"]


def test_equals_that_predict_the_same_are_no_reason_for_an_experiment(asked: list[Any]) -> None:
    lag, delay = suspect("actuator_lag", 60.0), suspect("input_delay", 58.0)
    spring, cable = suspect("arm_spring", 900.0), suspect("arm_cable", 899.0)
    alike = FoundEffect((lag, delay), equals=("input_delay",), same=("input_delay",))
    found = [alike, FoundEffect((spring, cable), equals=("arm_cable",))]
    told: Any = SimpleNamespace(naming=SimpleNamespace(found=found), after=SimpleNamespace(plant=PLANT))
    advice.design_next(told, [log(0.0)])
    assert [e.name for e in asked[0][1]] == ["arm_spring", "arm_cable"]


def test_nothing_is_designed_where_nothing_is_ambiguous(asked: list[Any]) -> None:
    assert advice.design_next(diagnosis(((), ())), [log(0.0)]) is None
    assert asked == []


def test_the_command_is_written(tmp_path: Path) -> None:
    t = np.arange(5) * 0.01
    design: Any = SimpleNamespace(samples=lambda: (t, np.sin(t)), whole_command=False, facts={"between": "a b"})
    advice.write_command(design, tmp_path)
    text = (tmp_path / advice.COMMAND_FILE).read_text(encoding="utf-8")
    assert "between: a b" in text
    assert "t,d" in text.replace(" ", "")
