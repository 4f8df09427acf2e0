"""Naming a hidden effect: a small trial on simulated logs (the bench's blind trials are the real test)."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from furuta_gym.plant import EFFECTS, TABLE_3, Effect
from identification.diagnosis.diagnose import diagnose
from identification.diagnosis.naming.fits import FitRequest, fit
from identification.diagnosis.naming.forward import START_NOISE
from identification.diagnosis.naming.next_effect import _of_successors
from identification.diagnosis.naming.probes import cells
from identification.diagnosis.naming.scores import _best_start, scores
from identification.diagnosis.naming.search import Search
from identification.kalman.record import Record
from tests.factories import loop_log, noisy_log
from tests.oracles import reference

SUSPECTS = ("arm_spring", "input_offset", "actuator_lag", "input_delay", "arm_stribeck", "pendulum_quadratic_drag")


@pytest.mark.parametrize("name", list(EFFECTS))
def test_every_effect_has_probes_that_are_possible(name: str) -> None:
    found = cells(EFFECTS[name], TABLE_3, (0.0, 20.0), np.array([1.0, 2.0]))
    starts = [cell.start(np.full(len(cell.probes), 0.7)) for cell in found]
    assert any(start is not None for start in starts)
    assert all(start is None or start.name == name for start in starts)
    assert all(len(cell.probes) == len(cell.sizes) for cell in found)


@pytest.mark.parametrize("name", ["input_delay", "actuator_lag", "input_dead_zone", "arm_backlash"])
def test_a_start_has_the_share_of_its_probe_that_the_data_ask_for(name: str) -> None:
    size = next(p for p in EFFECTS[name].parameters if p.role == "size")
    for cell in cells(EFFECTS[name], TABLE_3, (0.0, 20.0), np.array([1.0, 2.0])):
        start = cell.start(np.full(len(cell.probes), 0.7))
        assert start is not None
        assert start.parameters[size.name] == pytest.approx(0.7 * cell.probes[0][size.name])


def _signal(name: str, values: dict[str, float], rng: np.random.Generator) -> np.ndarray:
    """What an effect adds to torques, command and readings at random states, by the independent reference."""
    rows = []
    for _ in range(20):
        t, q1, q2, v1, v2, u = rng.uniform(-3.0, 3.0, 6)
        args = abs(t), q1, q2, v1, v2, TABLE_3.theta, 100.0, {name: values}, TABLE_3.theta, u
        y1, y2 = reference.measured(q1, q2, {name: values})
        rows.append(
            [*reference.extra_torques(*args), reference.static_command(u, {name: values}) - u, y1 - q1, y2 - q2]
        )
    return np.array(rows)


def _linear(name: str) -> bool:
    sizes = [p for p in EFFECTS[name].parameters if p.role == "size"]
    held = {"memory": EFFECTS[name].memory, "kernels": {"theta", "delay", "filter"} & set(EFFECTS[name].kernels)}
    return not any(held.values()) and not any(p.grid or not np.isfinite(p.neutral) or p.integer for p in sizes)


@pytest.mark.parametrize("name", [name for name in EFFECTS if _linear(name)])
def test_a_start_is_the_combination_of_its_probes(name: str) -> None:
    """Also where a phase or a product of two parameters makes it so."""
    weights = np.array([0.7, 0.4, 1.3, 0.5])
    for cell in cells(EFFECTS[name], TABLE_3, (0.0, 20.0), np.array([1.0, 2.0]))[:3]:
        start = cell.start(weights[: len(cell.probes)])
        assert start is not None
        signals = [_signal(name, p, np.random.default_rng(0)) for p in (*cell.probes, dict(start.parameters))]
        combined = sum(w * s for w, s in zip(weights, signals[:-1], strict=False))
        assert np.abs(combined).max() > 0
        np.testing.assert_allclose(signals[-1], combined, rtol=1e-9, atol=1e-12)


def test_a_cable_with_its_rest_far_away_is_a_start_too() -> None:
    """As an offset of the command looks: the descent to it is long and curved."""
    cable = EFFECTS["arm_cable"]
    (cell, *_) = cells(cable, TABLE_3, (0.0, 20.0), np.array([1.0]))
    far = {"k": 0.02, "q1n": 15.0, "k3": 0.001, "q1s": 4.0}
    probes = np.array([cable.coefficients(probe) for probe in cell.probes]).T
    start = cell.start(np.linalg.lstsq(probes, cable.coefficients(far))[0])
    assert start is not None
    assert start.parameters == pytest.approx(far, rel=1e-6)


def test_only_as_many_starts_are_made_as_need_be() -> None:
    made = []

    class Asked:
        def __init__(self, answer: str | None) -> None:
            self.answer = answer

        def start(self, weights: object, gram: object) -> str | None:
            made.append(self.answer)
            return self.answer

    none = np.zeros(0)
    order = [(3.0, Asked("third"), none, none), (9.0, Asked(None), none, none), (5.0, Asked("second"), none, none)]
    assert _best_start(order) == (5.0, "second")  # type: ignore[arg-type]
    assert made == [None, "second"]
    assert _best_start([]) == (0.0, None)


@pytest.mark.parametrize("name", ["actuator_lag", "arm_spring"])
def test_the_hidden_effect_is_named_and_sized(name: str) -> None:
    hidden = TABLE_3.default_effect(name)
    found = diagnose([noisy_log(4, TABLE_3.with_effects(hidden), duration=6.0)], start="table3", most=1, only=SUSPECTS)
    assert found.verdict == "named", str(found)
    added = found.plant.effect(name) if found.plant else None
    assert added is not None
    for p in EFFECTS[name].parameters:
        assert added.parameters[p.name] == pytest.approx(hidden.parameters[p.name], rel=0.1)
    assert found.plant.theta == pytest.approx(TABLE_3.theta, rel=0.25)


def test_nothing_is_named_where_nothing_is_missing() -> None:
    found = diagnose([noisy_log(6)], start="table3", most=1, only=SUSPECTS)
    assert found.verdict == "none", str(found)
    assert found.to_dict()["effects"] == []


def test_an_arm_that_is_held_says_nothing_of_effects() -> None:
    log = noisy_log(6)
    found = diagnose([replace(log, q1=np.zeros(len(log)))], start="table3")
    assert found.verdict == "insufficient_excitation"
    assert found.plant is None


def test_scores_rank_the_hidden_effect_first() -> None:
    hidden = TABLE_3.with_effects(TABLE_3.default_effect("arm_spring"))
    records = [Record.from_log(noisy_log(7, hidden, duration=6.0))]
    nominal = fit(FitRequest(TABLE_3, START_NOISE, records, anchor=TABLE_3))
    table = scores(nominal, SUSPECTS)
    assert max(table.values(), key=lambda s: s.gain).effect == "arm_spring"


def test_scores_know_that_the_zero_of_the_pendulum_is_free() -> None:
    """A zero of a count takes most of a small asymmetry in; what it leaves shows the size."""
    log, rig = loop_log("pendulum_coulomb_asymmetry", 0.2, duration=6.0)
    nominal = fit(FitRequest(TABLE_3, START_NOISE, [Record.from_log(log)], anchor=TABLE_3))
    score = scores(nominal, ["pendulum_coulomb_asymmetry"])["pendulum_coulomb_asymmetry"]
    (hidden,) = rig.effects
    assert score.start is not None
    assert score.start.parameters["a"] == pytest.approx(hidden.parameters["a"], rel=0.5)
    assert score.absorbed > 0.9


def test_scores_of_a_zero_that_cannot_move_are_those_of_the_plant() -> None:
    """A pendulum that hangs off by more than a fit's zero may be: the rest is no zero's, and an offset is suspected."""
    log, _ = loop_log("pendulum_encoder_offset", duration=6.0)
    nominal = fit(FitRequest(TABLE_3, START_NOISE, [Record.from_log(log)], anchor=TABLE_3))
    table = scores(nominal, ["pendulum_encoder_offset", "pendulum_coulomb_asymmetry", "base_tilt"])
    assert min(s.gain for s in table.values()) > 40.0
    assert max(s.absorbed for s in table.values()) < 0.4


def _pull(start: Effect, q1: np.ndarray) -> np.ndarray:
    """The torque of a cable at the angles q1."""
    none = 0.0, 0.0, 0.0, TABLE_3.theta, 100.0, {start.name: dict(start.parameters)}, TABLE_3.theta
    return np.array([reference.extra_torques(0.0, q, *none)[0] for q in q1])


CABLES = {
    "arm_cable": {"k": 0.1, "q1n": 0.2, "k3": 0.2, "q1s": -0.6},
    "arm_taut_cable": {"k1": 0.05, "k2": 0.9, "q1n": -0.1, "qt": 0.1},
}


@pytest.mark.parametrize("name", CABLES)
def test_scores_start_a_cable_near_the_hidden_one(name: str) -> None:
    """The start pulls as the hidden cable does over the angles of the log."""
    hidden = Effect(name, CABLES[name])
    log = noisy_log(8, TABLE_3.with_effects(hidden), duration=8.0)
    nominal = fit(FitRequest(TABLE_3, START_NOISE, [Record.from_log(log)], anchor=TABLE_3))
    found = scores(nominal, [*CABLES, "arm_hysteresis"])
    start = found[name].start
    assert start is not None
    assert found[name].gain > 0.9 * max(s.gain for s in found.values())
    angles = np.sort(log.q1)[:: len(log) // 50]
    true, ours = _pull(hidden, angles), _pull(start, angles)
    assert np.corrcoef(true, ours)[0, 1] > 0.9
    assert 0.25 < np.ptp(ours) / np.ptp(true) < 4.0  # the search tries other sizes of a start


def test_weights_beyond_the_bounds_start_the_nearest_possible_cable() -> None:
    (cell,) = cells(EFFECTS["arm_cable"], TABLE_3, (0.0, 20.0), np.array([1.0]))
    spring = {"k": 0.2, "q1n": 0.4, "k3": 0.0, "q1s": 0.0}
    columns = np.array([EFFECTS["arm_cable"].coefficients(p) for p in cell.probes]).T
    weights = np.linalg.solve(columns, EFFECTS["arm_cable"].coefficients(spring) + np.array([0, 0, 0, 1e-3]))  # k3 < 0
    start = cell.start(weights)
    assert start is not None
    assert start.parameters["k3"] == pytest.approx(0.0, abs=1e-3)
    assert start.parameters["k"] == pytest.approx(0.2, rel=0.3)
    assert cell.start(-weights) is None  # a spring that pushes away


def test_a_tilt_beyond_its_bounds_starts_within_them() -> None:
    """Weights that a score suggests know no bounds: a strong cable asks for a base that stands upright."""
    (cell, *_) = cells(EFFECTS["base_tilt"], TABLE_3, (0.0, 20.0), np.array([1.0]))
    start = cell.start(np.array([400.0, 0.5]))
    assert start is None or abs(start.parameters["αx"]) <= 0.5
    within = cell.start(np.array([2.0, 0.5]))
    assert within is not None
    assert within.parameters["αx"] == pytest.approx(2.0 * cell.probes[0]["αx"])
    assert within.parameters["G1"] == cell.probes[0]["G1"]


def test_friction_that_remembers_is_suspected_at_its_width() -> None:
    hidden = Effect("arm_hysteresis", {"κ": 1.5, "d": 0.05})
    log = noisy_log(9, TABLE_3.with_effects(hidden), duration=6.0)
    nominal = fit(FitRequest(TABLE_3, START_NOISE, [Record.from_log(log)], anchor=TABLE_3))
    found = scores(nominal, ["arm_hysteresis", "arm_stribeck", "arm_spring"])
    start = found["arm_hysteresis"].start
    assert start is not None
    assert max(found.values(), key=lambda s: s.gain).effect == "arm_hysteresis"
    assert 0.02 <= start.parameters["d"] <= 0.1
    assert start.parameters["κ2"] == 0.0
    again = fit(FitRequest(nominal.plant.with_effects(start), nominal.noise, nominal.records, anchor=TABLE_3))
    assert nominal.value - again.value > 20.0
    refitted = again.plant.effect("arm_hysteresis").parameters
    assert refitted["κ"] * refitted["d"] == pytest.approx(1.5 * 0.05, rel=0.2)
    assert refitted["d"] == pytest.approx(0.05, rel=0.2)
    assert refitted["κ2"] == 0.0  # optional: an estimator leaves it alone


def test_unknown_suspects_are_refused() -> None:
    with pytest.raises(ValueError, match="arm_sprung"):
        diagnose([noisy_log(6)], only=["arm_sprung"])


@pytest.mark.parametrize("missing", [True, False])
def test_what_no_score_can_suspect_is_fitted_where_something_is_missing(missing: bool) -> None:
    """Presliding replaces the friction that is there: it has no small size, and its score is nothing."""
    plant = TABLE_3.with_effects(TABLE_3.default_effect("arm_spring")) if missing else TABLE_3
    records = [Record.from_log(noisy_log(7, plant, duration=6.0))]
    nominal = fit(FitRequest(TABLE_3, START_NOISE, records, anchor=TABLE_3))
    names, table = Search(TABLE_3, ("arm_spring", "arm_presliding")).suspects(nominal, 0)
    assert table["arm_presliding"].gain < 2.0
    assert ("arm_presliding" in names) == missing
    assert names == [] or table["arm_presliding"].start is not None


def test_a_law_goes_with_what_takes_the_place_of_its_effect() -> None:
    """And not with an effect that was there all along, of which the one that went was only a rival."""

    def ranking(name: str, *rivals: str) -> Any:
        return tuple(SimpleNamespace(name=n) for n in (name, *rivals))

    cable, spring, drag = ranking("arm_cable", "arm_spring"), ranking("arm_spring"), ranking("arm_quadratic_drag")
    laws = {"arm_spring": "arm_cable"}
    assert _of_successors(laws, [cable, spring], [cable, drag]) == laws, "the spring went: nothing of another name"
    taut = ranking("arm_taut_cable", "arm_cable")
    assert _of_successors(laws, [cable, spring], [taut, spring, drag]) == {"arm_spring": "arm_taut_cable"}
    assert _of_successors(laws, [cable, spring], [ranking("arm_taut_cable", "arm_cable", "arm_spring"), drag]) == {}
