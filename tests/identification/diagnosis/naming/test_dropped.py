"""Where a fit starts without one of its effects."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import pytest

from furuta_gym.plant import TABLE_3, Effect
from identification.diagnosis.naming.dropped import dropped
from identification.diagnosis.naming.fits import Fit, FitRequest, fit
from identification.diagnosis.naming.forward import START_NOISE
from identification.kalman.record import Record
from tests.factories import loop_log
from tests.identification.diagnosis.fits import a_fit


@cache
def _with_offset() -> Fit:
    """An offset of the command, half of which a friction that differs by direction has taken over."""
    log, rig = loop_log("input_offset", duration=4.0)
    found = rig.effect("input_offset")
    assert found is not None
    half = 0.5 * found.parameters["b"]
    start = TABLE_3.with_effects(Effect("input_offset", {"b": half}), Effect("arm_coulomb_asymmetry", {"a": -half}))
    return fit(FitRequest(start, START_NOISE, [Record.from_log(log)], anchor=TABLE_3, effort="full"))


@pytest.mark.parametrize("name", ["input_offset", "arm_coulomb_asymmetry"])
def test_what_is_left_takes_over_the_part_of_what_goes(name: str) -> None:
    """Otherwise the fit without it would begin far from where it ends."""
    both = _with_offset()
    rest = dropped(both, name)
    (left,) = rest.plant.effects
    as_it_is = both.plant.replace(effects=(both.plant.effect(left.name),))
    ended = fit(FitRequest(rest.plant, both.noise, both.records, anchor=TABLE_3, effort="full"))
    (found,) = ended.plant.effects
    (size,) = found.parameters

    def away(value: float) -> float:
        return abs(value - found.parameters[size])

    assert away(left.parameters[size]) < 0.5 * away(as_it_is.effects[0].parameters[size])
    first = FitRequest(rest.plant, both.noise, both.records, anchor=TABLE_3, iterations=1)
    begins = [fit(request).value for request in (first, replace(first, plant=as_it_is))]
    assert begins[0] < begins[1]


def test_an_effect_that_nothing_imitates_leaves_the_rest_as_it_is() -> None:
    log, rig = loop_log("arm_spring", duration=4.0)
    alone = fit(FitRequest(rig, START_NOISE, [Record.from_log(log)], anchor=TABLE_3, effort="full"))
    rest = dropped(alone, "arm_spring")
    assert not rest.plant.effects
    assert rest.plant.theta == pytest.approx(alone.plant.theta, rel=0.02)


def test_a_fit_without_coordinates_keeps_the_rest() -> None:
    both = a_fit("arm_spring", "input_offset")
    assert dropped(both, "arm_spring").plant.effects == a_fit("input_offset").plant.effects
