"""The thresholds as a value: what is refused, and the page that lists them."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from furuta_gym.plant.parameters import FRICTION_SHARPNESS
from identification.diagnosis.policy import DecisionPolicy
from identification.estimation.long_logs import THINNED
from identification.kalman.noise_model import STRONG

PAGE = Path(__file__).parents[3] / "docs" / "decision_policy.md"
RULES = DecisionPolicy().rules()
NAMES = [rule.name for rule in RULES]
COUNTS = [rule.name for rule in RULES if isinstance(rule.value, int)]

not_positive = st.floats(max_value=0.0) | st.integers(max_value=0) | st.just(float("nan"))
no_number = st.sampled_from(["3", None, True, [1.0], 1j])


@given(st.sampled_from(NAMES), not_positive | no_number)
def test_bad_values_are_refused_with_a_sentence(name: str, value: Any) -> None:
    with pytest.raises(ValueError, match=f"^{name} must be a positive (int|float), got ") as error:
        replace(DecisionPolicy(), **{name: value})
    assert repr(value) in str(error.value)


@given(st.sampled_from(COUNTS), st.floats(0.1, 100.0))
def test_a_number_of_things_is_whole(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"{name} must be a positive int"):
        replace(DecisionPolicy(), **{name: value})


@given(st.sampled_from(NAMES), st.integers(1, 1000))
def test_one_value_can_be_replaced(name: str, value: int) -> None:
    usual = DecisionPolicy()
    other = replace(usual, **{name: value})
    assert other.to_dict() == usual.to_dict() | {name: value}
    assert (other == usual) == (value == getattr(usual, name))
    assert f"| `{name}` | {value:g}" in other.table()


def test_a_policy_cannot_be_changed() -> None:
    with pytest.raises(FrozenInstanceError):
        DecisionPolicy().believed = 1.0  # type: ignore[misc]


def test_every_rule_has_a_name_of_its_own_a_reason_and_an_origin() -> None:
    assert len(set(NAMES)) == len(NAMES) == len(DecisionPolicy().to_dict())
    assert len({rule.why for rule in RULES}) == len(RULES)
    for rule in RULES:
        assert rule.why
        assert rule.chosen_on


def test_a_search_has_the_usual_sharpness_and_thins_as_an_identification_does() -> None:
    policy = DecisionPolicy()
    assert policy.sharpness == FRICTION_SHARPNESS
    assert policy.thinned == THINNED


def test_a_search_and_an_identification_call_the_same_torque_strong() -> None:
    assert DecisionPolicy().strong == STRONG


def test_the_page_has_the_thresholds_of_the_code() -> None:
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    assert [line for line in lines if line.startswith("|")] == DecisionPolicy().table().splitlines()
