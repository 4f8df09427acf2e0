"""What the texts of options mean, and what they may not be."""

from __future__ import annotations

from functools import partial
from typing import Any

import pytest

from experiments.cli.options import fixed_values, prior_values, with_effects
from experiments.cli.train import _chances
from furuta_gym.plant import TABLE_3


def test_texts_of_options() -> None:
    assert fixed_values(["theta4=0.012", "theta2, r=50"]) == {"theta4": 0.012, "theta2": None, "r": 50.0}
    assert prior_values(["theta2=0.012±0.001", "theta4=1e-2+-1e-3"]) == {
        "theta2": (0.012, 0.001),
        "theta4": (0.01, 0.001),
    }
    spring = with_effects(TABLE_3, ["arm_spring:k=0.3"]).effect("arm_spring")
    assert spring is not None
    assert spring.parameters["k"] == 0.3
    with pytest.raises(ValueError, match="positive"):
        prior_values(["theta2=1±0"])


@pytest.mark.parametrize(
    ("read", "texts", "option"),
    [
        (fixed_values, ["theta4=0.01,theta4=0.02"], "--fix"),
        (fixed_values, ["theta4=0.01", "theta4"], "--fix"),
        (prior_values, ["r=50±5", "r=60±5"], "--prior"),
        (partial(with_effects, TABLE_3), ["arm_spring:k=0.3", "arm_spring:k=0.4"], "--effect"),
        (lambda texts: _chances("--reward", texts, "gentle=0.3"), ["gentle=0.3", "gentle=0.9"], "--reward"),
    ],
)
def test_a_name_that_stands_there_twice_is_refused(read: Any, texts: list[str], option: str) -> None:
    with pytest.raises(ValueError, match=f"{option}: .* stands there twice"):
        read(texts)


@pytest.mark.parametrize("value", ["-0.1", "2"])
def test_a_share_lies_between_zero_and_one(value: str) -> None:
    with pytest.raises(ValueError, match=f"--effect-chance input_delay={value}: expected a number from 0 to 1"):
        _chances("--effect-chance", [f"input_delay={value}"], "input_delay=0.5")
