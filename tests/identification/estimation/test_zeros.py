"""Logs of one rig that count from different zeros."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from furuta_gym.plant import TABLE_3
from identification.estimation.identify import identify
from identification.estimation.zeros import aligned, warn_about_zeros
from identification.logs.checks import LogError, LogWarning
from identification.validation.gap import validate
from tests.factories import loop_log, paper_log

ZERO = 0.4  # rad, of the arm in the second log


def test_a_held_out_log_is_predicted_from_its_own_zero() -> None:
    log, plant = loop_log("arm_spring", duration=6.0, seed=3)
    other = log.moved(-ZERO, 0.0)
    found = aligned(plant, [other])
    assert found.zeros[0][0] == pytest.approx(ZERO, abs=0.02)
    blind, own = validate(plant, other, own_zeros=False), validate(plant, other)
    assert own.ratio_to_floor < 1.2 < 2.0 < blind.ratio_to_floor


def test_a_fit_finds_the_zero_of_the_second_log() -> None:
    first, plant = loop_log("arm_spring", duration=6.0)
    second = loop_log("arm_spring", duration=6.0, seed=3)[0].moved(-ZERO, 0.0)
    with pytest.warns(LogWarning, match="counted from a zero"):
        estimate = identify([first, second], plant.replace(effects=()), effects=["arm_spring"])
    spring = plant.effect("arm_spring")
    assert spring is not None
    assert estimate.zeros[1][0] == pytest.approx(ZERO, abs=0.02)
    assert estimate.value("arm_spring.k") == pytest.approx(spring.parameters["k"], rel=0.05)


def test_every_log_has_its_own_zero_of_the_pendulum() -> None:
    """Upright a count grows to hundredths of a radian within the horizon."""
    count = 2 * math.pi / 4096
    first, plant = loop_log(duration=6.0)
    second = loop_log(duration=6.0, seed=3)[0].moved(0.0, -count)
    estimate = identify([first, second])
    assert estimate.zeros[1] == (0.0, pytest.approx(count, abs=0.3 * count))
    blind, own = validate(plant, second, own_zeros=False), validate(plant, second)
    assert own.zeros[0][1] == pytest.approx(count, abs=0.3 * count)
    assert own.rms[1] < 0.9 * blind.rms[1]


def test_the_first_log_has_one_too() -> None:
    """A pendulum set to zero by hand is a count off; held at zero, that count would go into θ."""
    count = 2 * math.pi / 4096
    log, _ = loop_log(duration=6.0)
    estimate = identify(log.moved(0.0, -count))
    assert estimate.zeros[0] == (0.0, pytest.approx(count, abs=0.3 * count))
    straight = identify(log)
    assert (estimate.values - straight.values) / straight.std == pytest.approx(0.0, abs=0.5)
    assert "log 1" not in str(straight), "nothing to tell of less than a count"
    assert "log 1 counts from" in str(identify(log.moved(0.0, -2.5 * count)))


def test_a_zero_that_ends_at_its_bound_is_told() -> None:
    """A pendulum that was set to zero a degree off: the fit goes three counts, as far as it may."""
    log, _ = loop_log(duration=6.0)
    told = "\n".join(identify(log.moved(0.0, -math.radians(1.0)), model_error=False).warnings)
    assert "the pendulum's zero ends at its bound of +4.6 mrad" in told
    assert "(pendulum_encoder_offset)" in told
    right = identify(log.moved(0.0, -2 * math.pi / 4096), model_error=False)
    assert not any("bound" in line for line in right.warnings)


def test_beside_a_tilt_the_zero_is_free() -> None:
    """A tilt is told from a zero by its turn with the arm. With the zero held, it was off by fifteen deviations."""
    count = 2 * math.pi / 4096
    log, plant = loop_log("base_tilt", duration=10.0)
    tilt = plant.effect("base_tilt")
    assert tilt is not None
    estimate = identify(log.moved(0.0, 0.7 * count), effects=["base_tilt"])
    for name, true in tilt.parameters.items():
        i = estimate.names.index(f"base_tilt.{name}")
        assert abs(estimate.values[i] - true) < 4.0 * estimate.std[i], name


def test_a_log_full_of_gaps_does_not_stop_what_is_said_of_others() -> None:
    log, plant = loop_log("arm_spring", duration=4.0, seed=3)
    good = log.moved(-ZERO, 0.0)
    useless = log.taken(np.flatnonzero(np.arange(len(log)) % 12))
    with pytest.warns(LogWarning, match="stretches of fewer than 20"):
        found = aligned(plant, [useless, good])
    assert 0 not in found.zeros
    assert found.logs[0] is useless
    assert found.zeros[1][0] == pytest.approx(ZERO, abs=0.02)
    assert found.zeros[1] == aligned(plant, [good]).zeros[0]
    with pytest.warns(LogWarning, match="stretches of fewer than 20"):
        gap = validate(plant, [useless, good])
    assert set(gap.log.tolist()) == {1}
    with pytest.warns(LogWarning), pytest.raises(LogError, match="no stretch of 20 samples"):
        aligned(plant, [useless])


@pytest.mark.parametrize(
    ("counts", "declared", "told"),
    [
        (None, None, r"\+0\.05 rad from the first"),
        (4096, None, r"\(\+33 counts\)"),
        (None, (2048, 2048), r"\(\+16 counts"),
    ],
)
def test_counts_are_told_where_the_arm_has_an_encoder(counts, declared, told) -> None:
    log = replace(paper_log(duration=4.0, counts=counts)[0], encoder_counts=declared)
    plant = TABLE_3.with_effects(TABLE_3.default_effect("arm_spring"))
    with pytest.warns(LogWarning, match=told):
        warn_about_zeros(plant, [log, log], {1: (0.05, 0.0)})
