"""Who is suspected while a search runs."""

from __future__ import annotations

from experiments.studio.suspects import best_plant, suspects
from furuta_gym.plant import TABLE_3
from identification.diagnosis.policy import DecisionPolicy
from identification.diagnosis.watched import Tried


def tried(likelihood: float, *names: str) -> Tried:
    return Tried(TABLE_3.with_effects(*(TABLE_3.default_effect(n) for n in names)), likelihood, False)


def test_the_best_is_first_and_who_is_far_behind_is_out() -> None:
    reach = DecisionPolicy().reach
    found = suspects(
        [
            tried(100.0),
            tried(300.0, "arm_spring"),
            tried(280.0, "arm_spring"),
            tried(300.0 - reach - 1, "base_tilt"),
            tried(300.0 - reach + 1, "arm_ripple"),
        ],
        now=["arm_ripple", "arm_stribeck"],
    )
    assert [s.name for s in found] == ["arm_spring", "arm_ripple", "base_tilt", "arm_stribeck"]
    assert [s.gain for s in found] == [200.0, 200.0 - reach + 1, 200.0 - reach - 1, None]
    assert [s.out for s in found] == [False, False, True, False]
    assert [s.tried_now for s in found] == [False, True, False, True]


def test_effects_that_are_fitted_together_are_told() -> None:
    (one, other) = suspects([tried(0.0), tried(5.0, "arm_spring", "arm_ripple")])
    assert {(one.name, one.beside), (other.name, other.beside)} == {
        ("arm_spring", ("arm_ripple",)),
        ("arm_ripple", ("arm_spring",)),
    }


def test_the_best_plant_so_far_has_an_effect() -> None:
    assert best_plant([tried(9.0)]) is None
    plant = best_plant([tried(9.0), tried(3.0, "arm_spring"), tried(4.0, "base_tilt")])
    assert plant is not None
    assert [e.name for e in plant.effects] == ["base_tilt"]
