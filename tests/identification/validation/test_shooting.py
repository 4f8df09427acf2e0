"""Multiple shooting: the truth from wrong starts, and what it says of itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from furuta_gym.plant import TABLE_3
from identification.validation.shooting import shooting
from tests.factories import loop_log, noisy_log

WRONG = np.array([1.1, 0.9, 1.1, 1.1, 1.1, 0.8, 1.3, 0.9, 1.2])


def test_the_truth_is_found_from_a_wrong_start_within_its_errors() -> None:
    log, truth = loop_log(duration=10.0)
    found = shooting(TABLE_3.replace(theta=TABLE_3.theta * WRONG), log)
    assert found.converged
    assert found.names[:2] == ("theta1", "theta2")
    assert found.values[[0, 2, 3, 4]] == pytest.approx(truth.theta[[0, 2, 3, 4]], rel=0.02)
    assert np.abs((found.values - truth.theta) / found.std).max() < 4.0
    assert found.plant.theta == pytest.approx(found.values)


def test_effects_have_errors_of_this_fit() -> None:
    log, truth = loop_log("arm_spring", duration=10.0)
    (spring,) = truth.effects
    earlier = truth.with_effects(replace(spring, std={"k": 1e3, "q1n": 1e3}))
    found = shooting(earlier, log)
    own = dict(zip(found.names, found.std, strict=True))
    assert dict(found.plant.effects[0].std) == pytest.approx({p: own[f"arm_spring.{p}"] for p in ("k", "q1n")})
    assert abs(found.plant.effects[0].parameters["k"] - spring.parameters["k"]) < 4.0 * own["arm_spring.k"]


def test_a_log_that_is_too_short_is_told() -> None:
    log, _ = loop_log(duration=1.0)
    with pytest.raises(ValueError, match="no log is long enough"):
        shooting(TABLE_3, log)


def test_intervals_hold_the_truth() -> None:
    """Starts that are smoothed under the plant hide half of its error; intervals must not."""
    found = [shooting(TABLE_3, noisy_log(seed, T=0.004)) for seed in range(4)]
    z = np.array([(f.values - TABLE_3.theta) / f.std for f in found])
    assert 0.4 < np.sqrt(np.mean(z**2)) < 1.4
    assert np.mean(np.abs(z) < 1.96) >= 0.85
