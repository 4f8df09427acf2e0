"""Supply and slew of the rig: one rule wherever a command is played."""

from __future__ import annotations

import numpy as np
import pytest

from controllers.comparison.trials import Starts, run_trials
from furuta_gym.envs.furuta import FurutaEnv
from furuta_gym.envs.vector import FurutaVectorEnv
from furuta_gym.plant import QUBE
from furuta_gym.simulation import simulate

SLEW, SUPPLY, T = 200.0, 6.0, 0.004
RIG = QUBE.replace(limits={"slew": SLEW, "supply": SUPPLY})
WANTED = np.repeat([9.0, -9.0, 0.3], 20)


def by_hand() -> np.ndarray:
    u, played = 0.0, []
    for wanted in np.clip(WANTED, -SUPPLY, SUPPLY):
        u += np.clip(wanted - u, -SLEW * T, SLEW * T)
        played.append(u)
    return np.array(played)


def test_the_env_gives_no_more_than_the_rig_can():
    env = FurutaEnv(RIG, "swing_up", sample_time=T)
    for _ in range(2):  # a new episode starts from no command
        env.reset(seed=1, options={"state": [0, 3, 0, 0]})
        played = [env.step([u])[4]["command"] for u in WANTED]
        np.testing.assert_allclose(played, by_hand(), atol=1e-6)


def test_an_action_of_several_samples_ramps_within_it():
    env = FurutaEnv(RIG, "swing_up", sample_time=T, action_time=5 * T)
    fast = FurutaEnv(RIG, "swing_up", sample_time=T)
    for e in (env, fast):
        e.reset(seed=1, options={"state": [0, 3, 0, 0]})
    for action in (9.0, -9.0):
        state = env.step([action])[4]["state"]
        for _ in range(5):
            info = fast.step([action])[4]
        np.testing.assert_allclose(state, info["state"], atol=1e-9)
    assert info["command"] == pytest.approx(0.0, abs=1e-6)  # up by five times 0.8, and down again


def test_many_envs_do_as_one():
    many = FurutaVectorEnv(3, RIG, "swing_up", sample_time=T)
    one = FurutaEnv(RIG, "swing_up", sample_time=T)
    state = [0.0, 3.0, 0.0, 0.0]
    many.reset(seed=1, options={"state": state})
    one.reset(seed=1, options={"state": state})
    for u in WANTED[:30]:
        observed = many.step(np.full((3, 1), u, dtype=np.float32))[0]
        np.testing.assert_allclose(observed[0], one.step(np.array([u], dtype=np.float32))[0], atol=1e-5)


def test_simulations_and_comparisons_play_the_same_commands():
    commands = iter(WANTED)
    played = simulate(RIG, lambda y: next(commands), len(WANTED) * T, sample_time=T, x0=(0, np.pi, 0, 0)).command
    np.testing.assert_allclose(played, by_hand(), atol=1e-12)
    again = iter(WANTED)
    starts = Starts(np.array([[0.0], [np.pi], [0.0], [0.0]]), np.zeros(1), np.zeros(1))
    outcome = run_trials(RIG, lambda y: next(again), starts, len(WANTED) * T, T, swing_up=True, hold=T)
    assert outcome.energy[0] == pytest.approx(np.sum(by_hand() ** 2) * T, rel=1e-3)
