"""Start values for friction that remembers, from the logs alone."""

from __future__ import annotations

from functools import cache

import pytest

from experiments.bench import HiddenEffect, Rig
from identification.estimation import most_likely
from identification.estimation.identify import identify
from identification.estimation.memories import MEMORIES, remembering
from identification.logs.log import Log
from tests.factories import TABLE_3, bench_log, hanging_log


@cache
def recorded(name: str, strength: float) -> tuple[Log, dict[str, float], dict[str, float]]:
    """(log, the effect's parameters, θ) of a rig of the bench, whose law of the effect is another than the plant's."""
    rig = Rig("table3", [HiddenEffect(name, strength, "bench")], individual=3, scatter=0.08, sample_time=2e-3)
    (hidden,) = rig.truth()["effects"]
    values = {k: v["value"] for k, v in hidden["parameters"].items()}
    return bench_log(rig, "wide", seed=5, duration=12.0), values, rig.truth()["theta"]


@pytest.mark.parametrize("strength", [8.0, 25.0])
def test_a_strong_hysteresis_is_found_where_it_is(strength: float) -> None:
    """Travel, stiffness and the arm's inertia: near enough for a descent."""
    log, hidden, theta = recorded("arm_hysteresis", strength)
    start = remembering([log], TABLE_3, "arm_hysteresis").starts[0].plant
    found = start.effects[0].parameters
    assert found["d"] == pytest.approx(hidden["d"], rel=0.15)
    assert found["κ"] * found["d"] == pytest.approx(hidden["κ"] * hidden["d"], rel=0.1)
    assert start.theta[0] == pytest.approx(theta["theta1"], rel=0.1)


@pytest.fixture(scope="module")
def balancing() -> tuple[Log, dict[str, float]]:
    """(log, the effect's parameters) of a strong hysteresis, balancing, where the arm turns little."""
    rig = Rig("table3", [HiddenEffect("arm_hysteresis", 23.0, "bench")], individual=3, scatter=0.1, sample_time=2e-3)
    hidden = {k: v["value"] for k, v in rig.truth()["effects"][0]["parameters"].items()}
    return bench_log(rig, "paper", seed=5, duration=16.0), hidden


def test_a_fit_by_name_arrives_from_there(balancing: tuple[Log, dict[str, float]]) -> None:
    """From model (5) the descent ends 1600 nats higher, at a fifth of κ and seven times the travel."""
    log, hidden = balancing
    found = identify(log, effects=["arm_hysteresis"])
    assert found.value("arm_hysteresis.d") == pytest.approx(hidden["d"], rel=0.15)
    assert found.value("arm_hysteresis.κ") == pytest.approx(hidden["κ"], rel=0.2)


@pytest.mark.parametrize("which", [0, -1])
def test_every_effect_that_was_asked_for_is_fitted(which: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whichever of these starts, with one effect that remembers each, a fit goes on from."""
    asked = {"arm_hysteresis", "arm_presliding", "input_delay"}
    monkeypatch.setattr(most_likely, "from_grids", lambda *given: given[-1][which])
    log, *_ = recorded("arm_hysteresis", 8.0)
    found = identify(log.slice(stop=4.0), effects=sorted(asked), iterations=2)
    assert {e.name for e in found.plant.effects} == asked


def test_a_bristle_takes_the_place_of_coulombs_friction() -> None:
    log, hidden, theta = recorded("arm_presliding", 2.0)
    start = remembering([log], TABLE_3, "arm_presliding").starts[0].plant
    assert start.theta[7] == pytest.approx(theta["theta8"], rel=0.15)
    assert start.effects[0].parameters["σ0"] == pytest.approx(hidden["σ0"], rel=0.15)


def test_logs_do_not_run_into_each_other() -> None:
    """Two logs say what one does, wherever their angles start."""
    log, *_ = recorded("arm_hysteresis", 8.0)
    for name in MEMORIES:
        one = remembering([log], TABLE_3, name).starts
        two = remembering([log, log.moved(3.0, 0.0)], TABLE_3, name).starts
        for a, b in zip(one, two, strict=True):
            assert b.plant.effects[0].parameters == pytest.approx(dict(a.plant.effects[0].parameters), rel=1e-3)
            assert b.plant.theta == pytest.approx(a.plant.theta, rel=1e-3)


def test_no_start_where_no_memory_explains_more() -> None:
    assert remembering([hanging_log()], TABLE_3, "arm_hysteresis").starts == ()


@pytest.mark.parametrize("name", MEMORIES)
def test_a_log_without_a_command_says_nothing_of_a_memory(name: str) -> None:
    log = hanging_log()
    free = Log(log.t, log.q1, log.q2, 0.0 * log.u, input_unit=log.input_unit)
    found = remembering([free], TABLE_3, name)
    assert found.starts == ()
    assert found.left == 1.0
