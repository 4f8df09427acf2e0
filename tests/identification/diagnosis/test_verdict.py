"""The decision rules by themselves, on values made by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import identification.diagnosis.naming as naming_module
import identification.diagnosis.race as race_module
from furuta_gym.plant import TABLE_3, Effect
from identification.diagnosis.candidates import Score
from identification.diagnosis.diagnose import CONSTANT, Diagnosis, _verdict, structured
from identification.diagnosis.naming import Suspect, _mends, price, shortlist


def suspect(name: str, gain: float) -> Suspect:
    return Suspect(name, gain, gain - 5.0, fit=None)  # type: ignore[arg-type]


def naming(*found: Suspect, equals: tuple[tuple[str, ...], ...] | None = None, refused: Suspect | None = None) -> Any:
    return SimpleNamespace(accepted=found, equals=equals or tuple(() for _ in found), refused=refused)


def rest(evidence: float = -4.0, p: float = 0.5) -> Any:
    return SimpleNamespace(
        found=evidence > 8.0,
        evidence=evidence,
        channel="arm",
        variable="arm angle",
        constancy=SimpleNamespace(joint_p=p),
    )


@pytest.mark.parametrize(
    ("found", "left", "verdict"),
    [
        (naming(), rest(), "none"),
        (naming(), rest(evidence=50.0), "unknown"),
        (naming(), rest(p=0.1 * CONSTANT), "unknown"),
        (naming(suspect("arm_spring", 200.0)), rest(), "named"),
        (naming(suspect("arm_spring", 200.0)), rest(evidence=50.0), "named"),
        (naming(suspect("arm_spring", 200.0)), rest(evidence=300.0), "unknown"),
        (naming(suspect("input_delay", 200.0), equals=(("actuator_lag",),)), rest(), "ambiguous"),
    ],
)
def test_the_verdict(found: Any, left: Any, verdict: str) -> None:
    said, sentence = _verdict(found, left)
    assert said == verdict
    assert structured(left) == ("remains" in sentence)


def test_a_frequency_and_an_instant_cost_more_than_a_size() -> None:
    n = math.log(20_000)
    assert price("input_offset", 20_000) == pytest.approx(0.5 * n)
    assert price("periodic_torque", 20_000) == pytest.approx(2.5 * n)  # Djuric 1998: 5/2 ln N for a sinusoid
    assert price("payload_step", 20_000) == pytest.approx(1.5 * n)


def test_a_further_effect_must_explain_its_share() -> None:
    drag = suspect("pendulum_quadratic_drag", 1900.0)
    assert _mends([drag, suspect("pendulum_stribeck", 270.0)])
    assert _mends([drag, suspect("input_offset", 60.0), suspect("input_delay", 50.0)])
    assert not _mends([drag, suspect("input_delay", 900.0)])


def test_what_is_refused_is_left_over_and_told() -> None:
    found = naming(suspect("arm_spring", 900.0), refused=suspect("input_delay", 40.0))
    said, sentence = _verdict(found, rest())
    assert said == "named"
    assert "input_delay would take up a little more (40 nats)" in sentence
    parts: Any = (None, None, found, rest())
    assert Diagnosis(said, sentence, *parts, 0.0, 1.0, 1.0).leftover


def test_the_short_list_is_near_the_best_and_above_the_price() -> None:
    gains = {"arm_spring": 100.0, "arm_ripple": 90.0, "input_delay": 14.0, "input_offset": 2.0}
    table = {n: Score(n, g, TABLE_3.default_effect(n), 0.0) for n, g in gains.items()}
    assert shortlist(table, 20_000, 0.5) == ["arm_spring", "arm_ripple"]
    assert shortlist({"input_offset": table["input_offset"]}, 20_000, 0.5) == []


def test_a_veto_takes_the_name_and_the_plant_back() -> None:
    before, after = SimpleNamespace(plant="without"), SimpleNamespace(plant="with")
    parts: Any = (before, after, naming(suspect("arm_spring", 200.0)), rest())
    found = Diagnosis("named", "…", *parts, 0.0, 1.0, 1.0)
    assert found.plant == "with"
    assert not found.timed
    vetoed = found.vetoed()
    assert vetoed.verdict == "unknown"
    assert vetoed.plant == "without"
    drift: Any = (before, after, naming(suspect("arm_friction_drift", 200.0)), rest())
    assert Diagnosis("named", "…", *drift, 0.0, 1.0, 1.0).timed


def test_a_leader_that_is_overtaken_follows_from_the_new_leaders_parameters(monkeypatch: pytest.MonkeyPatch) -> None:
    """A stuck first leader must not lose its name to a look-alike that found the right θ from it."""
    plant = TABLE_3

    def fitted(name: str, value: float) -> Any:
        own = plant.with_effects(plant.default_effect(name))
        return SimpleNamespace(plant=own, noise=np.ones(4), value=value, samples=1000)

    values = {"arm_spring": 50.0, "arm_ripple": 60.0}
    reached = {"arm_spring": 5.0, "arm_ripple": 20.0}  # from another's θ
    asked: list[list[str]] = []

    def race(entries: Any, current: Any, anchor: Any, ahead: float = math.inf) -> dict[str, Any]:
        if any(" " in entry for entry in entries):  # other sizes: bring nothing here
            return {}
        asked.append(list(entries))
        told = values if math.isinf(ahead) else reached
        return {name: fitted(name if name in told else "arm_ripple", told.get(name, math.inf)) for name in entries}

    for module in (naming_module, race_module):
        monkeypatch.setattr(module, "race", race)
    monkeypatch.setattr(naming_module, "fit", lambda p, *a, **k: fitted(p.effects[-1].name, 5.0) if p.effects else left)
    left: Any = SimpleNamespace(plant=plant, noise=np.ones(4), value=100.0, records=())
    table = {name: Score(name, 40.0, plant.default_effect(name), 0.0) for name in values}
    search = naming_module._Search(plant, None, lambda text: None)
    _, ranking = search.refits(left, list(values), table)
    assert asked == [["arm_spring", "arm_ripple"], ["arm_ripple"], ["arm_spring"], ["-1", "+1"]]
    assert ranking[0].name == "arm_spring"
    assert ranking[0].gain == pytest.approx(95.0)


def test_whole_numbers_walk_to_the_best(monkeypatch: pytest.MonkeyPatch) -> None:
    plant = TABLE_3

    def fitted(n: float) -> Any:
        own = plant.with_effects(Effect("arm_ripple", {"A": 0.1, "n": n, "φ": 0.0}))
        return SimpleNamespace(plant=own, noise=np.ones(4), value=abs(n - 16.0))

    def race(entries: Any, current: Any, anchor: Any, ahead: float) -> dict[str, Any]:
        return {step: fitted(p.effects[-1].parameters["n"]) for step, (p, _) in entries.items()}

    monkeypatch.setattr(race_module, "race", race)
    without: Any = SimpleNamespace(plant=plant)
    for start in (14.0, 16.0, 17.0, 1.0):
        assert race_module.whole_numbers(fitted(start), without, plant).plant.effects[-1].parameters["n"] == 16.0
    spring: Any = SimpleNamespace(plant=plant.with_effects(plant.default_effect("arm_spring")), value=1.0)
    assert race_module.whole_numbers(spring, without, plant) is spring
