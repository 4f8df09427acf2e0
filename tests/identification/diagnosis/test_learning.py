"""What is learned where no name explains a torque, and when it is refused."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from furuta_gym.plant import TABLE_3, Effect
from furuta_gym.plant.effects.learned import COEFFICIENTS, surface_columns
from identification.diagnosis import learning
from identification.diagnosis.held_out import HeldOut
from identification.diagnosis.learned import Learned
from identification.discrepancy.learned import Surface, most_likely_surface
from identification.kalman.record import stretches
from identification.logs.log import Log
from identification.validation.gap import validate
from tests.factories import TORQUE_NOISE, closed_loop, hanging_log, loop_log, scaled_effect
from tests.identification.diagnosis.fits import POLICY, a_diagnosis, rest


def test_the_surface_is_the_torque_that_was_hidden():
    log, plant = loop_log("arm_spring", size=0.5, duration=10.0)
    (spring,) = plant.effects
    records = [s.record for s in stretches([log])]
    found = most_likely_surface(plant.replace(effects=()), records, refitted=False)
    assert found.evidence > 50.0
    p = found.effect.parameters
    run = records[0]
    v1 = np.gradient(run.y[:, 0], run.t)
    columns = surface_columns(run.y[:, 0], v1, p["low"], p["width"], p["w"])
    torque = columns @ np.array([p[name] for name in COEFFICIENTS])
    true = -spring.parameters["k"] * (run.y[:, 0] - spring.parameters["q1n"])
    assert np.std(torque - true) < 0.25 * np.std(true)


def test_a_surface_stands_beside_friction_that_remembers_and_not_in_its_place():
    """A cable and a stop: a table of (q1, q̇1) has no memory, with the stop beside it it predicts another run."""
    stop = Effect("arm_hysteresis", {"κ": 2.0, "d": 0.05})
    rig = TABLE_3.with_effects(scaled_effect("arm_spring", 0.5), stop)
    runs = [closed_loop(rig, duration=8.0, seed=s, torque_noise=TORQUE_NOISE, longest_step=5e-4) for s in (0, 5)]
    fitted, other = (Log.from_run(run, rig.unit, 4096) for run in runs)
    records = [s.record for s in stretches([fitted])]
    ratios = []
    for plant in (TABLE_3, TABLE_3.with_effects(stop)):
        found = plant.with_effects(most_likely_surface(plant, records, refitted=False).effect)
        ratios.append(validate(found, other).ratio_to_floor)
    alone, beside = ratios
    assert beside < 1.4
    assert alone > 2.0 * beside


def test_nothing_is_learned_where_nothing_is_missing():
    log, plant = loop_log(duration=10.0)
    held = HeldOut((log,), (hanging_log(),), POLICY)
    assert most_likely_surface(plant, held_records(held)).evidence < 3.0
    assert learning.learned_from(plant, {}, held) is None


def held_records(held: HeldOut) -> list[Any]:
    return [s.record for s in stretches(held.logs)]


def test_it_is_added_where_it_holds_in_another_experiment_and_the_gap_shrinks():
    upright, rig = loop_log("arm_spring", size=0.5, duration=6.0)
    held = HeldOut((hanging_log(rig),), (upright,), POLICY)
    found = learning.learned_from(TABLE_3, {}, held)
    assert found is not None
    assert found.added, found.reason
    assert found.change.over_floor(found.change.after) < 0.6 * found.change.over_floor(found.change.before)
    assert found.plant.effect("arm_learned") is not None
    assert found.to_dict()["added"] is True
    assert found.plant.provenance["start"] == "the search for missing effects"


@pytest.mark.parametrize(("others", "reason"), [(0, "no other log of this rig"), (1, "another kind of experiment")])
def test_without_another_experiment_it_is_refused(monkeypatch, others, reason):
    surface = Surface(Effect("arm_learned", {"c00": 0.1}), 100.0)
    monkeypatch.setattr(learning, "most_likely_surface", lambda *_: surface)
    monkeypatch.setattr(learning, "identify", lambda *_, **__: pytest.fail("a fit of which nothing can come"))
    first, *more = (loop_log(duration=4.0, seed=seed)[0] for seed in (0, 5)[: 1 + others])
    found = learning.learned_from(TABLE_3, {}, HeldOut((first,), tuple(more), POLICY))
    assert found is not None
    assert not found.added
    assert reason in found.reason


def test_what_harms_held_out_data_is_refused(monkeypatch):
    """A torque that pushes the arm away, as a fit to one log may invent it."""
    push = Effect("arm_learned", {"low": -1.0, "width": 2.0, **dict.fromkeys(COEFFICIENTS, 0.3)})
    monkeypatch.setattr(learning, "most_likely_surface", lambda *_: Surface(push, 100.0))
    logs = loop_log(duration=4.0)[0], loop_log(duration=4.0, seed=5)[0], hanging_log()
    refused = learning.learned_from(TABLE_3, {}, HeldOut(logs[:1], logs[1:], POLICY), refitted=False)
    assert refused is not None
    assert not refused.added
    assert "grows" in refused.reason


@pytest.mark.parametrize("added", [True, False])
def test_it_changes_the_plant_where_it_is_added_and_never_the_verdict(monkeypatch, added):
    plant = TABLE_3.with_effects(Effect("arm_learned", {"c00": 0.1}))
    asked: list[Any] = []

    def learned_from(*arguments: Any, **more: Any) -> Learned:
        asked.append((arguments, more))
        return Learned(plant, 100.0, None, added, "so it is")

    monkeypatch.setattr(learning, "learned_from", learned_from)
    held = HeldOut((), (), POLICY)
    estimate: Any = SimpleNamespace(plant=TABLE_3, zeros={0: (0.1, 0.0)})
    before = a_diagnosis("arm_spring", after=estimate, rest=rest(40.0))
    told = learning.with_learned(before, held)
    assert (told.verdict, told.found) == (before.verdict, before.found)
    assert told.summary.endswith("so it is.")
    assert told.plant is (plant if added else TABLE_3)
    noise = before.naming and before.naming.final.noise
    assert asked == [((TABLE_3, {0: (0.1, 0.0)}, held, noise), {"refitted": True})]
    assert told.learned is not None
    assert told.learned.to_dict()["added"] is added
    assert learning.with_learned(replace(before, rest=rest()), held).learned is None, "nothing that matters"


def _judged_by(monkeypatch: pytest.MonkeyPatch, **closed: float) -> str:
    """Why a torque learned on a hanging pendulum is refused, by the share that it closes of kinds of experiment, from
    twice the floor on. NaN: before it was just below the floor, and grows."""
    parts = []
    for kind, share in closed.items():
        ratios = (0.98, 1.2) if math.isnan(share) else (2.0, math.sqrt(1.0 + 3.0 * (1.0 - share)))
        interval = SimpleNamespace(value=share, interval=(share, share))
        parts.append(SimpleNamespace(name=kind, closed=interval, over_floor=ratios))
    change = SimpleNamespace(by_kind=parts, closed=SimpleNamespace(value=0.5, interval=(0.4, 0.6)))
    monkeypatch.setattr(HeldOut, "gap", lambda *_: None)
    monkeypatch.setattr(HeldOut, "change", lambda *_: change)
    return learning._judged(TABLE_3, TABLE_3, HeldOut((hanging_log(),), (), POLICY))[1]


def test_without_a_window_of_another_experiment_nobody_has_judged_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """A log that is too short for a prediction counts for nothing."""
    assert "too short" in _judged_by(monkeypatch, hanging=0.5)
    assert _judged_by(monkeypatch, hanging=0.5, upright=0.5) == ""


def test_the_kind_of_experiment_where_it_does_not_hold_is_the_one_that_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    reason = _judged_by(monkeypatch, upright=0.5, turning=0.0)
    assert "turning" in reason
    assert "upright" not in reason


def test_an_error_that_grows_from_below_the_floor_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """No share of a gap is defined there."""
    reason = _judged_by(monkeypatch, upright=0.5, hanging=math.nan)
    assert "grows: hanging" in reason
