"""Logs of a diagnosis between which the rig changed."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from furuta_gym.plant import TABLE_3, Plant
from identification import Diagnosis, diagnose, identify
from identification.diagnosis.one_plant import first_alone, likelier
from identification.logs.checks import LogWarning
from identification.logs.log import Log
from tests.factories import noisy_log, scaled_effect

SPRING = TABLE_3.with_effects(scaled_effect("arm_spring"))


def logs_of(*plants: Plant) -> list[Log]:
    """A log of each, as of one day after another."""
    runs = [noisy_log(seed, plant, T=0.004, duration=5.0) for seed, plant in enumerate(plants)]
    return [
        Log(r.t, r.q1, r.q2, r.u, encoder_counts=r.encoder_counts, source=f"day{i}.csv") for i, r in enumerate(runs)
    ]


def heavier(plant: Plant, factor: float) -> Plant:
    return plant.replace(theta=plant.theta * np.array([1.0 + 0.2 * (factor - 1.0), *[factor] * 4, 1, 1, 1, 1]))


@pytest.fixture(scope="module")
def changed() -> Diagnosis:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LogWarning)  # a wrong name moves a zero, before it is dropped
        return diagnose(logs_of(TABLE_3, heavier(TABLE_3, 1.2)), only=["arm_encoder_eccentricity", "arm_spring"])


def test_a_pendulum_that_became_heavier_between_two_logs_is_no_effect(changed: Diagnosis) -> None:
    assert changed.verdict == "none"
    assert changed.different is not None
    assert changed.different.sources == ("day0.csv", "day1.csv")
    assert changed.different.factors["theta4"] == pytest.approx(1.2, rel=0.08)
    assert changed.different.one_factor is None
    assert max(changed.different.ratios) < 1.1
    assert changed.plant is not None
    assert changed.plant.theta[4] == pytest.approx(TABLE_3.theta[4], rel=0.1)  # of the first log


def test_it_is_said_and_not_called_fine(changed: Diagnosis) -> None:
    assert changed.different is not None
    assert changed.leftover
    assert "theta4 by a factor of 1." in changed.summary
    assert "day0.csv alone" in changed.summary
    entry = changed.to_dict()["different_plants"]
    assert entry["sources"] == ["day0.csv", "day1.csv"]
    assert entry["factors"] == changed.different.factors


def test_which_logs_are_searched_further(changed: Diagnosis) -> None:
    logs = logs_of(TABLE_3, TABLE_3)
    assert changed.different is not None
    assert first_alone(logs, changed.different) == (logs[0],)


def test_what_chance_gains_makes_no_two_plants_of_one() -> None:
    logs = logs_of(TABLE_3, TABLE_3)
    joint = identify(logs, model_error=False)
    alone = [identify(log, model_error=False) for log in logs]
    assert sum(e.log_likelihood for e in alone) > joint.log_likelihood  # more parameters always gain
    assert likelier(alone, joint) < 0.0


def test_held_out_logs_of_a_weaker_supply_do_not_judge_names() -> None:
    weaker = SPRING.replace(theta=SPRING.theta / 0.8)
    searched, held_out = logs_of(SPRING, weaker)
    found = diagnose(searched, held_out, only=["arm_spring", "arm_taut_cable"])
    assert [suspect.name for suspect in found.named] == ["arm_spring"]
    assert found.different is not None
    assert found.different.sources == ("the searched logs", "the held-out logs")
    assert found.different.one_factor == pytest.approx(1.25, rel=0.02)
    assert "the supply" in found.summary
    assert found.gap is not None
    assert found.gap.tail is not None  # of the searched log
    assert found.gap.after_over_floor < 1.5
    assert found.second is None  # no plant is chosen by what another rig does


def test_logs_of_one_rig_are_of_one_plant() -> None:
    first, second = logs_of(SPRING, SPRING)
    for searched, held_out in (([first, second], None), (first, second)):
        found = diagnose(searched, held_out, only=["arm_spring"])
        assert [suspect.name for suspect in found.named] == ["arm_spring"]
        assert found.different is None
        assert found.to_dict()["different_plants"] is None
