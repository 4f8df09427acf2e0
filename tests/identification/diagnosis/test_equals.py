"""Whether it matters which of two names is right."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from furuta_gym.plant import TABLE_3, Effect
from identification.diagnosis.equals import interchangeable
from identification.diagnosis.naming.found import FoundEffect
from identification.diagnosis.naming.suspects import Suspect
from identification.diagnosis.policy import DecisionPolicy
from tests.factories import loop_log
from tests.identification.diagnosis.fits import NOISE, ToyFit


def _suspect(name: str, friction: float = 1.0, **parameters: float) -> Suspect:
    plant = TABLE_3.replace(theta=TABLE_3.theta * [1, 1, 1, 1, 1, friction, 1, friction, 1])
    fitted: Any = ToyFit(plant.with_effects(Effect(name, parameters)), NOISE, -60.0)
    return Suspect(name, 60.0, 56.0, fitted)


@pytest.mark.parametrize(("late", "same"), [(0.0008, ("input_delay",)), (0.02, ())])
def test_a_short_lag_and_a_short_delay_predict_the_same_and_long_ones_do_not(
    late: float, same: tuple[str, ...]
) -> None:
    lag, delay = _suspect("actuator_lag", T=late), _suspect("input_delay", d=late)
    found = FoundEffect((lag, delay), ("input_delay",))
    log, _ = loop_log(duration=6.0)
    assert interchangeable(found, [log], DecisionPolicy()) == same


@pytest.mark.parametrize(("friction", "same"), [(1.0, ()), (2.0, ("input_delay",))])
def test_what_no_prediction_is_good_enough_to_show_need_not_be_told(friction: float, same: tuple[str, ...]) -> None:
    """Two thirds of a count lie between the two. With twice the friction predictions are off by 23 counts."""
    lag, delay = _suspect("actuator_lag", friction, T=0.005), _suspect("input_delay", friction, d=0.005)
    found = FoundEffect((lag, delay), ("input_delay",))
    log, _ = loop_log(duration=6.0)
    assert interchangeable(found, [log], DecisionPolicy()) == same


@pytest.mark.parametrize(("late", "same"), [(0.0002, ("input_delay",)), (0.02, ())])
def test_equals_can_be_the_same_where_nobody_declared_the_counts(late: float, same: tuple[str, ...]) -> None:
    lag, delay = _suspect("actuator_lag", T=late), _suspect("input_delay", d=late)
    found = FoundEffect((lag, delay), ("input_delay",))
    log = replace(loop_log(duration=6.0)[0], encoder_counts=None)
    assert interchangeable(found, [log], DecisionPolicy()) == same


def test_without_equals_there_is_nothing_to_compare() -> None:
    lag = _suspect("actuator_lag", T=0.01)
    log, _ = loop_log(duration=2.0)
    assert interchangeable(FoundEffect((lag,)), [log], DecisionPolicy()) == ()
