"""Two plants of a rig: what differs for certain, and what does not."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.stats import kstest

from furuta_gym.plant import EFFECTS, TABLE_3, THETA_NAMES, Effect, Plant
from furuta_gym.plant.covariance import Covariance
from identification.estimation.identify import identify
from identification.validation.plant_changes import plant_change
from tests.factories import noisy_log

RELATIVE = 0.01


def estimated(theta: np.ndarray, *, effects: tuple[Effect, ...] = (), logs: str = "", **changes) -> Plant:
    """A plant file as a fit writes it: errors of one per cent of Table 3, correlated."""
    rng = np.random.default_rng(5)
    names = (*THETA_NAMES, *(f"{e.name}.{p}" for e in effects for p in e.parameters))
    size = np.abs([*TABLE_3.theta, *(v for e in effects for v in e.parameters.values())]) * RELATIVE
    root = np.eye(len(names)) + 0.3 * rng.normal(size=(len(names), len(names)))
    correlation = root @ root.T
    scale = size / np.sqrt(np.diag(correlation))
    covariance = Covariance(names, correlation * np.outer(scale, scale))
    provenance = {"logs": [{"source": f"{logs}.csv", "sha256": logs}]} if logs else {}
    return TABLE_3.replace(theta=theta, effects=effects, covariance=covariance, provenance=provenance, **changes)


def drawn(seed: int) -> tuple[Plant, Plant]:
    """Two estimates of the same θ."""
    rng, plain = np.random.default_rng(seed), estimated(TABLE_3.theta)
    assert plain.covariance is not None
    root = np.linalg.cholesky(plain.covariance.matrix)
    first, second = (estimated(TABLE_3.theta + root @ rng.normal(size=9)) for _ in range(2))
    return first, second


def test_estimates_of_an_unchanged_rig_differ_by_chance_alone() -> None:
    found = [plant_change(*drawn(seed)) for seed in range(400)]
    assert kstest([f.p for f in found], "uniform").pvalue > 0.01
    assert np.std([d.sure for f in found for d in f.differences]) == pytest.approx(1.0, abs=0.06)
    # nine parameters at three deviations, and one test of all together
    assert np.mean([bool(f.changed) for f in found]) < 0.05
    assert sum(f.one_factor is not None for f in found) < 8


@pytest.mark.parametrize("name", THETA_NAMES)
def test_a_parameter_that_changed_is_told_with_its_size_and_interval(name: str) -> None:
    i, theta = THETA_NAMES.index(name), TABLE_3.theta.copy()
    theta[i] *= 1.1
    found = plant_change(estimated(TABLE_3.theta), estimated(theta))
    assert found.changed
    assert [d.name for d in found.certain] == [name]
    change, half = found.certain[0].percent
    assert change == pytest.approx(10.0)
    assert half == pytest.approx(100 * 1.96 * RELATIVE * np.hypot(1.0, 1.1), rel=0.01)
    assert found.certain[0].shows_from == pytest.approx(100 * 3 * np.sqrt(2) * RELATIVE)
    assert f"θ{i + 1} +10 % (" in str(found)


def test_many_small_changes_are_seen_together() -> None:
    a, b = estimated(TABLE_3.theta), estimated(TABLE_3.theta)
    assert a.covariance is not None
    values, vectors = np.linalg.eigh(a.covariance.matrix / np.outer(TABLE_3.theta, TABLE_3.theta))
    # along a direction that is known well, where no single error bar shows it, and that is no common factor
    k = int(np.argmin(np.abs(vectors[:, :3].sum(axis=0))))
    moved = TABLE_3.theta * (1 + 8 * np.sqrt(2 * values[k]) * vectors[:, k])
    found = plant_change(a, b.replace(theta=moved))
    assert not found.certain
    assert found.changed
    assert found.chi2 == pytest.approx(64.0, rel=1e-6)
    assert "all together do" in str(found)


def test_another_supply_is_one_factor() -> None:
    found = plant_change(estimated(TABLE_3.theta), estimated(TABLE_3.theta * 1.1))
    assert found.one_factor == pytest.approx(1.1, rel=0.01)
    assert "one factor, 1.1" in str(found)
    assert "look at the supply" in str(found)
    assert "Differs by more" not in str(found)  # it is said once


def test_an_effect_s_parameter_is_compared_too() -> None:
    spring = [Effect("arm_spring", {"k": k, "q1n": 0.1}) for k in (0.5, 0.6)]
    old, new = (estimated(TABLE_3.theta, effects=(s,)) for s in spring)
    found = plant_change(old, new)
    assert [d.name for d in found.certain] == ["arm_spring.k"]
    assert found.certain[0].unit == "V/rad"


def test_plants_with_other_effects_are_not_compared() -> None:
    with_spring = estimated(TABLE_3.theta, effects=(Effect("arm_spring", {"k": 0.5, "q1n": 0.1}),))
    found = plant_change(estimated(TABLE_3.theta), with_spring)
    assert found.changed is None
    assert "only the second has arm_spring" in str(found)
    assert "No change" not in str(found)
    assert found.unjudged == ("arm_spring.k", "arm_spring.q1n")


def test_plants_of_the_same_log_are_not_compared() -> None:
    found = plant_change(estimated(TABLE_3.theta, logs="a"), estimated(TABLE_3.theta * 1.2, logs="a"))
    assert found.changed is None
    assert "both were fitted to a.csv" in str(found)
    assert plant_change(estimated(TABLE_3.theta, logs="a"), estimated(TABLE_3.theta, logs="b")).changed is False


def test_what_a_log_did_not_show_is_not_judged() -> None:
    blind = {"identifiability": {"not_identified": ["theta9"]}}
    found = plant_change(estimated(TABLE_3.theta), estimated(TABLE_3.theta * 1.2, checks=blind))
    assert found.unjudged == ("theta9",)
    assert "theta9" not in {d.name for d in found.differences}
    same = str(plant_change(estimated(TABLE_3.theta), estimated(TABLE_3.theta, checks=blind)))
    assert "No change shows in θ1, θ2, θ3" in same
    assert "Of θ9 these logs say nothing" in same


def test_a_value_that_changes_its_sign_has_no_factor() -> None:
    theta = TABLE_3.theta * np.where(np.arange(9) == 8, -1.0, 1.0)
    found = plant_change(estimated(TABLE_3.theta), estimated(theta))
    (d,) = found.certain
    assert d.factor is None
    assert f"θ9 from {TABLE_3.theta[8]:.3g} to -" in str(found)


def test_a_parameter_without_an_error_is_compared_as_known() -> None:
    exact = TABLE_3.replace(covariance=Covariance(("theta5",), np.zeros((1, 1))))
    assert plant_change(exact, exact).changed is False
    found = plant_change(exact, exact.replace(theta=TABLE_3.theta * np.where(np.arange(9) == 4, 1.01, 1)))
    assert found.certain[0].sure == np.inf
    assert found.to_dict()["parameters"]["theta5"]["deviations"] is None


def test_the_json_has_no_number_that_json_lacks() -> None:
    found = plant_change(estimated(TABLE_3.theta), estimated(TABLE_3.theta * 1.1))
    assert json.loads(json.dumps(found.to_dict(), allow_nan=False))["changed"] is True


def test_plants_that_cannot_be_compared_are_refused() -> None:
    with pytest.raises(ValueError, match="no error bars"):
        plant_change(TABLE_3, estimated(TABLE_3.theta))
    with pytest.raises(ValueError, match=r"one command is in V, the other in N·m"):
        plant_change(estimated(TABLE_3.theta), estimated(TABLE_3.theta, unit="N·m"))


def test_logs_of_two_rigs_and_of_one() -> None:
    heavier = TABLE_3.replace(theta=TABLE_3.theta * [1.05, 1.2, 1.2, 1.2, 1.2, 1, 1, 1, 1])
    rigs = (TABLE_3, TABLE_3, heavier)
    plants = [identify(noisy_log(seed, rig, T=0.004, duration=6.0)).plant for seed, rig in enumerate(rigs)]
    assert plant_change(plants[0], plants[1]).changed is False
    found = plant_change(plants[1], plants[2])
    assert {"theta3", "theta4", "theta5"} <= {d.name for d in found.certain}
    assert not {"theta6", "theta7", "theta8", "theta9"} & {d.name for d in found.certain}


def test_the_sharpness_of_friction_is_not_judged() -> None:
    names = (*THETA_NAMES, "r")
    sharp = [
        TABLE_3.replace(
            friction_sharpness=r, covariance=Covariance(names, np.diag([*(0.01 * TABLE_3.theta), 2.0]) ** 2)
        )
        for r in (44.0, 99.0)
    ]
    found = plant_change(*sharp)
    assert found.changed is False
    assert found.unjudged == ("r",)


def test_one_factor_too_small_for_any_single_parameter_is_a_change() -> None:
    found = plant_change(estimated(TABLE_3.theta), estimated(TABLE_3.theta * 1.02))
    assert found.one_factor == pytest.approx(1.02, abs=0.01)
    assert found.changed
    assert "No change" not in str(found)


def test_what_counts_from_the_zero_or_the_clock_of_a_log_is_not_judged() -> None:
    """The arm's zero is where it stood at power-on."""
    old, new = (
        estimated(TABLE_3.theta, effects=(Effect("arm_spring", {"k": 0.5, "q1n": rest}),)) for rest in (0.1, 0.4)
    )
    found = plant_change(old, new)
    assert found.changed is False
    assert found.unjudged == ("arm_spring.q1n",)


def test_what_the_arm_s_zero_or_the_clock_of_a_log_moves_is_of_a_day() -> None:
    """And nothing else is: what is of a day tells nothing of a rig that changed."""
    assert {f"{name}.{p.name}" for name, kind in EFFECTS.items() for p in kind.parameters if p.of_a_day} == {
        "arm_cable.q1n", "arm_cable.q1s", "arm_taut_cable.q1n", "arm_taut_cable.qt", "arm_spring.q1n", "arm_ripple.φ",
        "arm_position_friction.a", "arm_position_friction.b", "arm_encoder_eccentricity.a",
        "arm_encoder_eccentricity.b", "base_tilt.αx", "base_tilt.αy",
        "arm_friction_drift.a", "arm_viscous_drift.a", "input_gain_drift.a", "input_gain_drift.s", "periodic_torque.φ",
        "payload_step.m", "payload_step.t0",
    }  # fmt: skip


def test_values_that_were_held_must_be_the_same() -> None:
    def held(theta4: float) -> Plant:
        plant = estimated(TABLE_3.theta * np.where(np.arange(9) == 3, theta4, 1.0))
        assert plant.covariance is not None
        return plant.replace(covariance=plant.covariance.without("theta4"))

    found = plant_change(held(1.0), held(1.02))
    assert found.changed is None
    assert "other values of θ4, which a fit held" in str(found)
    assert plant_change(held(1.0), held(1.0)).changed is False
    # held in one, estimated in the other: by more than chance, or not
    free = estimated(TABLE_3.theta)
    assert plant_change(free, held(1.1)).held == ("theta4",)
    within = plant_change(free, held(1.01))
    assert within.changed is False
    assert within.unjudged == ("theta4",)


def test_ripples_of_another_number_a_turn_are_not_compared() -> None:
    ripples = (Effect("arm_ripple", {"A": 0.1, "n": n, "φ": 0.3}) for n in (7, 11))
    plants = [estimated(TABLE_3.theta, effects=(ripple,)) for ripple in ripples]
    plants = [p.replace(covariance=p.covariance.without("arm_ripple.n")) for p in plants]
    assert plant_change(*plants).held == ("arm_ripple.n",)


def test_a_covariance_may_name_an_effect_that_was_taken_out() -> None:
    plant = estimated(TABLE_3.theta, effects=(Effect("arm_spring", {"k": 0.5, "q1n": 0.1}),)).replace(effects=())
    assert plant_change(plant, plant).changed is False


@pytest.mark.parametrize(
    ("one", "other", "shared"),
    [
        ({}, {}, True),
        ({"cut_s": [[0.0, 10.0]], "duration_s": 10.0}, {"cut_s": [[10.0, 20.0]], "duration_s": 10.0}, False),
        ({"cut_s": [[0.0, 10.0]], "duration_s": 10.0}, {"cut_s": [[12.0, 20.0]], "duration_s": 12.0}, True),
        ({"cut_s": [[0.0, 10.0], [15.0, 16.0]], "duration_s": 10.0}, {"stretches_s": [[15.2, 15.8]]}, False),
        ({"skipped_s": 5.0, "duration_s": 15.0}, {"stretches_s": [[0.0, 2.0], [3.0, 5.0]]}, False),
        ({"skipped_s": 5.0, "duration_s": 15.0}, {"stretches_s": [[0.0, 2.0], [3.0, 5.5]]}, True),
    ],
)
def test_two_parts_of_a_log_may_be_compared(one: dict, other: dict, shared: bool) -> None:
    plants = []
    for part in (one, other):
        entry = {"source": "a.csv", "sha256": "a", **part}
        plants.append(estimated(TABLE_3.theta).replace(provenance={"logs": [entry]}))
    assert bool(plant_change(*plants).shared_logs) is shared
