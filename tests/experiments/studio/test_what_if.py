"""What the sliders of the what-if view move."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from experiments.studio.what_if import Choice, moved_by_hand
from furuta_gym.plant import TABLE_3, THETA_NAMES, Covariance, Effect, Plant


@pytest.fixture
def fit() -> Plant:
    """A plant as a fit leaves it."""
    return TABLE_3.replace(
        covariance=Covariance(THETA_NAMES, np.diag(np.square(1e-3 * TABLE_3.theta))),
        provenance={"method": "prediction-error", "log_likelihood": 56914.0, "logs": [{"sha256": "ab"}]},
    )


def test_what_was_learned_can_be_switched_and_not_moved() -> None:
    learned, spring = Effect("arm_learned", {"c33": 0.1}), TABLE_3.default_effect("arm_spring")
    assert moved_by_hand(learned.type, learned.parameters) == []
    assert [p.name for p in moved_by_hand(spring.type, spring.parameters)] == ["k", "q1n"]
    assert moved_by_hand(spring.type, {"k": math.inf, "q1n": 0.0})[0].name == "q1n"


def test_what_nobody_moved_is_the_fit(fit: Plant) -> None:
    choice = Choice(fit)
    choice.theta[5] *= 1.3
    assert choice.plant() != fit
    choice.reset()
    assert choice.plant() == fit


def test_what_was_moved_is_no_fit_and_says_what_was_moved(fit: Plant, tmp_path: Path) -> None:
    choice = Choice(fit)
    choice.theta[5] *= 1.3
    choice.add("arm_spring")
    choice.plant().save(tmp_path / "plant.json")
    saved = json.loads((tmp_path / "plant.json").read_text())
    origin = saved["provenance"]
    assert origin["method"] == "moved by hand from prediction-error"
    assert origin["moved"] == {"theta6": fit.theta[5], "arm_spring.k": None, "arm_spring.q1n": None}
    assert origin["logs"] == [{"sha256": "ab"}]
    assert "log_likelihood" not in origin
    assert saved["covariance"] is None


def test_what_was_moved_is_moved_on_from_the_same_fit(fit: Plant) -> None:
    choice = Choice(fit)
    choice.theta[5] *= 1.3
    kept = choice.plant()
    again = Choice(fit)
    again.take(kept)
    assert again.plant() == kept
    again.theta[6] *= 1.3
    assert again.plant().provenance["method"] == "moved by hand from prediction-error"
    assert again.plant().provenance["moved"] == {"theta6": fit.theta[5], "theta7": fit.theta[6]}
    again.theta[5] = fit.theta[5]
    assert again.plant().provenance["moved"] == {"theta7": fit.theta[6]}
    again.reset()
    assert again.plant() == fit


def test_an_effect_that_was_taken_off_is_named_with_what_it_was(fit: Plant) -> None:
    choice = Choice(fit.with_effects(Effect("arm_spring", {"k": 0.1, "q1n": 0.2}, {"k": 0.01})))
    choice.off.add("arm_spring")
    assert choice.plant().provenance["moved"] == {"arm_spring.k": 0.1, "arm_spring.q1n": 0.2}
    choice.off.clear()
    choice.effects["arm_spring"]["k"] = 0.3
    assert choice.plant().effects[0].std == {}
    assert choice.plant().provenance["moved"] == {"arm_spring.k": 0.1}


def test_a_plant_whose_sharpness_was_fitted_keeps_it(fit: Plant) -> None:
    choice = Choice(fit)
    choice.take(fit.replace(friction_sharpness=55.0))
    choice.theta[5] *= 1.3
    assert choice.plant().friction_sharpness == 55.0
