"""A wrong zero of the pendulum's encoder that follows from another effect: the counter was set while it hung."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from furuta_gym import simulate
from furuta_gym.plant import QUBE, TABLE_3, Effect, Plant
from furuta_gym.simulation import open_loop
from identification import Log
from identification.diagnosis.naming.found import FoundEffect, Naming
from identification.diagnosis.naming.hung import set_while_hanging
from identification.diagnosis.naming.suspects import Suspect
from identification.diagnosis.sentences import misses
from identification.kalman.record import stretches
from tests.identification.diagnosis.fits import NOISE, ToyFit

COUNT = 2.0 * math.pi / 4096
TILT = Effect("base_tilt", {"αx": 0.02, "αy": -0.015, "G1": 3.0})
OFF_CENTRE = Effect("pendulum_encoder_eccentricity", {"a": 0.03, "b": 0.02})


def resting(plant: Plant, q1: float) -> float:
    """Where the pendulum comes to rest near −π, the arm held near q1 by nothing but its friction: by simulation."""
    slow = plant.replace(theta=plant.theta * [1e3, 1, 1, 1, 1, 1e3, 20, 1, 0])  # an arm too heavy to move
    run = simulate(slow, open_loop(0.0), 20.0, sample_time=0.01, x0=(q1, -math.pi, 0.0, 0.0))
    return float(run.state[-1, 1])


def fitted(plant: Plant, first: float, q1: float = 0.3, moving: float = 0.0) -> Any:
    """A fit of a log whose pendulum reads `first` at rest, or `moving` counts further in each sample."""
    t = np.arange(100) * 0.004
    q2 = first + moving * COUNT * np.arange(100) + np.where(t > 0.1, 0.3 * np.sin(20.0 * (t - 0.1)), 0.0)
    log = Log(t, q1 + np.where(t > 0.1, 0.1 * np.sin(9.0 * t), 0.0), q2, np.sin(t), encoder_counts=4096)
    return ToyFit(plant, NOISE, 0.0, records=tuple(stretch.record for stretch in stretches([log])))


@pytest.mark.parametrize("q1", [0.0, 0.3, 2.0])
def test_a_tilt_makes_the_zero_wrong_that_was_set_at_rest(q1):
    tilted = QUBE.with_effects(TILT)
    b = -math.pi - resting(tilted, q1)
    assert abs(b) > 0.01
    for off, found in ((0.0, "base_tilt"), (1.0 * COUNT, "base_tilt"), (0.05, None)):
        rig = tilted.with_effects(Effect("pendulum_encoder_offset", {"b": b + off}))
        assert set_while_hanging(fitted(rig, -math.pi, q1)) == found


def test_an_encoder_off_its_centre_is_right_where_it_was_set():
    b = 2.0 * OFF_CENTRE.parameters["b"]
    rig = QUBE.with_effects(OFF_CENTRE, Effect("pendulum_encoder_offset", {"b": b}))
    assert set_while_hanging(fitted(rig, math.pi)) == "pendulum_encoder_eccentricity"
    assert set_while_hanging(fitted(rig, math.pi + 3 * COUNT)) is None, "it was not set here"
    assert set_while_hanging(fitted(rig, math.pi, moving=1.0)) is None, "it moved"
    assert set_while_hanging(fitted(rig, 0.0)) is None, "it stood upright"


def test_a_tilt_that_does_not_lean_here_explains_no_zero():
    """Friction may hold the pendulum some counts off, but then the tilt has nothing to do with it."""
    rig = TABLE_3.with_effects(
        Effect("base_tilt", {"αx": 0.02, "αy": 0.0, "G1": 3.0}), Effect("pendulum_encoder_offset", {"b": 5.0 * COUNT})
    )
    assert abs(TABLE_3.theta[8] / TABLE_3.theta[4]) > 5.0 * COUNT
    assert set_while_hanging(fitted(rig, math.pi, q1=0.0)) is None


def test_only_the_zero_is_said_to_follow():
    """A ripple that describes the law of the same tilt does not."""
    rig = QUBE.with_effects(TILT)
    b = -math.pi - resting(rig, 0.3)
    rig = rig.with_effects(Effect("pendulum_encoder_offset", {"b": b}), QUBE.default_effect("arm_ripple"))
    final = fitted(rig, -math.pi)
    found = tuple(FoundEffect((Suspect(effect.name, 100.0, 90.0, final),)) for effect in rig.effects)
    naming = Naming(final, final, found, (), {}, laws={"arm_ripple": "base_tilt"})
    assert [effect.name for effect in naming.own] == ["base_tilt"]
    assert naming.relation("pendulum_encoder_offset").startswith("follows from base_tilt")
    assert naming.relation("arm_ripple") == "describes what the law of base_tilt misses"
    told = misses(naming)
    assert "follows a wrong zero of the pendulum's encoder (pendulum_encoder_offset)" in told
    assert "cogging of the arm (arm_ripple) describes the difference" in told


def test_a_zero_by_itself_follows_from_nothing():
    assert set_while_hanging(fitted(QUBE.with_effects(Effect("pendulum_encoder_offset", {"b": 0.0})), math.pi)) is None
    assert set_while_hanging(fitted(QUBE.with_effects(TILT), math.pi)) is None
