"""What an effect says of a rig: one sentence with its size, in the units of the plant, for any values."""

from __future__ import annotations

import math
import re

import pytest

from furuta_gym.plant import EFFECTS, TABLE_3, Effect
from furuta_gym.plant.effects.words import Quantity, percent


@pytest.mark.parametrize("name", EFFECTS)
def test_every_effect_has_a_title_and_a_sentence_with_its_size(name):
    effect = TABLE_3.default_effect(name)
    sentence = effect.sentence("N·m")
    assert re.search(r"\d", sentence)
    assert sentence[0].isupper()
    assert not sentence.endswith(".")
    assert not re.search(r"nan|inf|_|\{|\bV\b", sentence)
    title = EFFECTS[name].title
    assert title[0].islower()
    assert "_" not in title


@pytest.mark.parametrize("name", EFFECTS)
def test_the_sentence_follows_the_size(name):
    """Another size, another sentence: no sentence is only a text."""
    effect = TABLE_3.default_effect(name)
    sizes = [p for p in effect.type.parameters if p.role == "size" and not p.optional]
    for scale in (0.5, 1.3):
        values = {**effect.parameters, **{p.name: scale * effect.parameters[p.name] for p in sizes}}
        assert Effect(name, values).sentence("V") != effect.sentence("V")


def test_titles_tell_effects_apart():
    assert len({effect.title for effect in EFFECTS.values()}) == len(EFFECTS)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("arm_spring:k=0.117,q1n=0.314", "A cable pulls the arm towards 18°: 0.117 V/rad"),
        ("arm_friction_drift:a=-0.02", "The arm's Coulomb friction falls by 2 % a second during the run"),
        ("arm_friction_drift:a=0.02", "The arm's Coulomb friction rises by 2 % a second during the run"),
        ("pendulum_encoder_offset:b=-0.012", "The pendulum's encoder reads −0.69° when the pendulum is upright"),
        ("base_tilt:αx=0.03,αy=0.04", "The base is tilted by 2.9°"),
        ("input_delay:d=0.006", "The command reaches the motor 6 ms late"),
        ("payload_step:m=0.04,t0=8", "From 8 s on, the pendulum is 4 % heavier"),
        ("arm_backlash:b=0.01", "There is a backlash of 1.1° between motor and arm"),
        ("friction_sharpness:r1=12", "Friction sets in with a sharpness of 12 s/rad on the arm"),
        (
            "arm_coulomb_asymmetry:a=-0.04",
            "The arm's friction is 0.08 V larger turning to the negative side",
        ),
    ],
)
def test_the_words_are_the_physics(text, sentence):
    assert Effect.parse(text).sentence("V") == sentence


@pytest.mark.parametrize(
    ("value", "unit", "shown"),
    [
        (0.11659, "V/rad", "0.117 V/rad"),
        (math.pi, "rad", "180°"),
        (-0.01, "rad", "−0.57°"),
        (1.5e-7, "V", "1.5e−07 V"),
        (123456.0, "V", "123000 V"),
        (0.0, "V", "0 V"),
        (12.0, "1", "12"),
        (0.05, "s", "50 ms"),
        (9.996, "V", "10 V"),
    ],
)
def test_numbers_are_short_and_have_their_unit(value, unit, shown):
    assert f"{Quantity(value, unit)}" == shown


def test_a_share_is_a_percentage_without_its_sign():
    assert percent(-0.083) == "8.3 %"
