"""Two effects at once, every pair: the order in which they are named must not matter, and the oracle agrees."""

import itertools

import numpy as np
import pytest

from furuta_gym.plant import EFFECTS, LARGE_RIG, Effect
from tests.furuta_gym.plant.helpers import readings, reference_run, run, square_waves
from tests.oracles import reference

T_U = np.arange(16) * 0.005
STOP = 0.08
U = 1.5 * square_waves(2 * T_U)
X0 = [0.4, 2.4, 1.5, -2.0]


def effect_of(name: str) -> Effect:
    """Default size on the large rig, a payload that arrives within the short motion."""
    values = dict(LARGE_RIG.default_effect(name).parameters)
    return Effect(name, values | ({"t0": 0.03} if name == "payload_step" else {}))


MOVING = [name for name in EFFECTS if EFFECTS[name].place != "sensor"]


@pytest.mark.parametrize("first", MOVING)
def test_every_pair_moves_as_the_oracle_in_either_order(first):
    failures = []
    for second in MOVING[MOVING.index(first) + 1 :]:
        a, b = effect_of(first), effect_of(second)
        plant = LARGE_RIG.with_effects(a, b)
        theirs = reference_run(plant, X0, T_U, U, STOP, rtol=1e-9, atol=1e-10)[:, :4]
        event = {"arm_backlash", "payload_step"} & {first, second}
        for order in (plant, LARGE_RIG.with_effects(b, a)):
            ours = run(order, X0, T_U, U, STOP, 1e-5)[:, :4]
            angle, speed = np.abs(ours - theirs).max(axis=0).reshape(2, 2).max(axis=1)
            if angle > (1e-6 if event else 1e-8) or speed > (3e-4 if event else 1e-6):
                failures.append(f"{' then '.join(e.name for e in order.effects)}: {angle:.1e} rad, {speed:.1e} rad/s")
    assert not failures, "\n".join(failures)


SENSORS = [name for name in EFFECTS if EFFECTS[name].place == "sensor"]


@pytest.mark.parametrize("pair", list(itertools.permutations(SENSORS, 2)), ids="+".join)
def test_sensor_pairs_read_as_the_oracle_in_either_order(pair):
    """The table's terms add: each is a function of the true angle."""
    effects = [effect_of(name) for name in pair]
    for q1, q2 in np.random.default_rng(4).uniform(-4, 4, (20, 2)):
        theirs = reference.measured(q1, q2, {e.name: dict(e.parameters) for e in effects})
        np.testing.assert_allclose(readings(LARGE_RIG.with_effects(*effects), q1, q2), theirs, atol=1e-12)


def test_all_effects_at_once_move_as_the_oracle():
    plant = LARGE_RIG.with_effects(*(effect_of(name) for name in MOVING if name != "arm_backlash"))
    ours = run(plant, X0, T_U, U, STOP, 1e-5)[:, :4]
    np.testing.assert_allclose(ours, reference_run(plant, X0, T_U, U, STOP)[:, :4], atol=1e-5)
    assert np.isfinite(ours).all()
