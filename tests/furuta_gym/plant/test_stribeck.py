"""Stribeck's curve with any exponent, and the start of its wider law."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from furuta_gym.plant import EFFECTS, TABLE_3
from furuta_gym.plant.effects.stribeck import stribeck_level

NAMES = ["arm_stribeck", "pendulum_stribeck"]


@given(v=st.floats(-1e5, 1e5), vs=st.floats(0.01, 3.0), δ=st.floats(0.5, 4.0))
def test_the_curve_is_the_formula(v, vs, δ):
    power = abs(v / vs) ** δ
    assert stribeck_level(v, 0.3, vs, δ) == pytest.approx(0.3 * math.exp(-power), abs=1e-13)


@given(v=st.floats(-50.0, 50.0), vs=st.floats(0.01, 3.0))
def test_the_plain_curve_joins_its_neighbours(v, vs):
    """δ = 2 takes another way through the code."""
    plain, near = (stribeck_level(v, 1.0, vs, δ) for δ in (2.0, 2.0 + 1e-9))
    assert near == pytest.approx(plain, abs=1e-7)


@pytest.mark.parametrize("v", [1e80, -1e200, math.inf])
def test_no_speed_is_too_large(v):
    assert 0.0 <= stribeck_level(v, 1.0, 0.3, 4.0) < 1e-300


@pytest.mark.parametrize("name", NAMES)
def test_the_wider_law_starts_where_the_plain_one_falls_to_half(name):
    kind = EFFECTS[name]
    plain = TABLE_3.default_effect(name).parameters
    assert plain["δ"] == 2.0
    assert [p.name for p in kind.in_play(plain)] == ["ΔF", "vs"]
    assert kind.wider is not None
    (wider,) = kind.wider(plain)
    assert [p.name for p in kind.in_play(wider)] == ["ΔF", "vs", "δ"]
    half = plain["vs"] * math.sqrt(math.log(2.0))
    assert stribeck_level(half, 1.0, wider["vs"], wider["δ"]) == pytest.approx(0.5, abs=0.01)
    assert kind.wider(wider) == ()
