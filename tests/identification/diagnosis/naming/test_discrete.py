"""What no descent moves: whole numbers and rough sizes."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

import identification.diagnosis.naming.discrete as stepping_module
from furuta_gym.plant import EFFECTS, TABLE_3, Effect
from identification.diagnosis.naming.discrete import best_of, starts_of, stepped
from identification.diagnosis.naming.scores import repeating
from identification.kalman.coordinates import plant_coordinates
from identification.kalman.noise_model import Noise
from tests.identification.diagnosis.fits import a_fit


def with_value(effect: str, parameter: str, x: float, value: float) -> Any:
    start = TABLE_3.default_effect(effect)
    plant = TABLE_3.with_effects(Effect(effect, {**start.parameters, parameter: x}))
    return SimpleNamespace(plant=plant, noise=Noise((1.0, 1.0)), value=value, samples=1000, records=())


def test_whole_numbers_walk_to_the_best(monkeypatch: pytest.MonkeyPatch) -> None:
    plant = TABLE_3

    def fitted(n: float) -> Any:
        own = plant.with_effects(Effect("arm_ripple", {"A": 0.1, "n": n, "φ": 0.0}))
        return SimpleNamespace(plant=own, noise=Noise((1.0, 1.0)), value=abs(n - 16.0))

    def race(entries: Any, current: Any, anchor: Any, ahead: float) -> dict[str, Any]:
        return {step: fitted(p.effects[-1].parameters["n"]) for step, (p, _) in entries.items()}

    monkeypatch.setattr(stepping_module, "race", race)
    without: Any = SimpleNamespace(plant=plant)
    for start in (14.0, 16.0, 17.0, 1.0):
        assert stepped(fitted(start), without, plant).plant.effects[-1].parameters["n"] == 16.0
    spring: Any = SimpleNamespace(plant=plant.with_effects(plant.default_effect("arm_spring")), value=1.0)
    assert stepped(spring, without, plant) is spring


@pytest.mark.parametrize("start", [0.004, 0.02, 0.047, 0.3])
def test_a_rough_size_walks_to_the_best(monkeypatch: pytest.MonkeyPatch, start: float) -> None:
    """No descent moves it here: every fit ends at the size where it starts."""

    def fitted(b: float) -> Any:
        return with_value("arm_backlash", "b", b, abs(math.log(b / 0.05)))

    def race(entries: Any, current: Any, anchor: Any, ahead: float) -> dict[str, Any]:
        return {key: fitted(p.effects[-1].parameters["b"]) for key, (p, _) in entries.items()}

    monkeypatch.setattr(stepping_module, "race", race)
    best = stepped(fitted(start), a_fit(), TABLE_3).plant.effects[-1].parameters["b"]
    assert best == pytest.approx(0.05, rel=0.05)  # half of the narrow step, and a little


def test_a_rough_size_starts_from_its_whole_grid_and_others_from_their_score() -> None:
    start = Effect("arm_backlash", {"b": 0.013})
    entries = starts_of(start, a_fit(), TABLE_3)
    sizes = sorted(plant.effects[-1].parameters["b"] for plant, _ in entries.values())
    (b,) = EFFECTS["arm_backlash"].parameters
    assert isinstance(b.grid, tuple)
    assert sizes == pytest.approx(sorted([0.013, *b.grid]))
    assert {key.split()[0] for key in entries} == {"arm_backlash"}
    assert list(starts_of(TABLE_3.default_effect("input_delay"), a_fit(), TABLE_3)) == ["input_delay"]


def test_of_the_starts_of_a_suspect_the_best_counts() -> None:
    fits = {
        "arm_backlash": a_fit("arm_backlash", value=3.0),
        "arm_backlash b = 0.05": a_fit("arm_backlash", value=-9.0),
        "input_delay": a_fit("input_delay", value=1.0),
    }
    assert {name: fitted.value for name, fitted in best_of(fits).items()} == {"arm_backlash": -9.0, "input_delay": 1.0}


def test_what_repeats_must_repeat_within_the_log() -> None:
    """A third of a period is a drift: no log of its length says that it ever comes back."""
    plant = TABLE_3.with_effects(TABLE_3.default_effect("periodic_torque"))
    kept = {c.name: repeating(c, 20.0) for c in plant_coordinates(plant)}
    assert kept["periodic_torque.f"].low == pytest.approx(0.1)  # two periods
    for c in plant_coordinates(plant):
        if c.name != "periodic_torque.f":
            assert kept[c.name] == c
