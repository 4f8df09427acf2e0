"""The reward: its formula, what it prefers, its weights and the margin of the arm."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from furuta_gym.envs.furuta import FurutaEnv
from furuta_gym.plant import TABLE_3


def expected_reward(state, command, plant):
    """The formula of FurutaEnv's docstring."""
    q1, q2, v1, v2 = state
    upright = (1 + np.cos(q2)) / 4 + 0.5 / (1 + 2 * (1 - np.cos(q2)) / 0.2**2)
    centred = 0.5 + 0.5 / (1 + q1**2)
    calm = 0.5 + 0.5 / (1 + (v1**2 + v2**2) / max(plant.theta[4] / plant.theta[3], 1))
    return upright * centred * calm * (1 - (command / plant.u_max) ** 2 / 4)


@given(st.tuples(*[st.floats(-5, 5)] * 4), st.floats(-30, 30))
@settings(max_examples=40)
def test_reward_is_the_documented_one_of_the_state_after_the_step(state, command):
    env = FurutaEnv(task="swing_up")
    env.reset(seed=0, options={"state": state})
    _, reward, _, _, info = env.step([command])
    assert info["command"] == pytest.approx(np.clip(command, -10, 10))
    assert reward == pytest.approx(expected_reward(info["state"], info["command"], TABLE_3), rel=1e-12)


def test_reward_prefers_upright_centred_calm_and_gentle():
    def reward(state, command=0.0):
        env = FurutaEnv(task="swing_up", sample_time=1e-4)  # the state after the step is nearly that before it
        env.reset(seed=0, options={"state": state})
        return env.step([command])[1]

    assert reward((0, 0, 0, 0)) == pytest.approx(1.0, abs=1e-3)
    for worse in ((1, 0, 0, 0), (0, 0.2, 0, 0), (0, 0, 3, 0), (0, 0, 0, 3)):
        assert reward(worse) < 0.9
    assert reward((0, 0, 0, 0), 10) == pytest.approx(0.75, abs=0.01)
    assert reward((0, np.pi, 0, 0)) < 0.01


@pytest.mark.parametrize("reward", ["smooth", "tolerant"])
def test_weights_of_the_reward_and_the_margin_of_the_arm(reward):
    """Each weight is what its factor can take away; the last two factors are those of the documentation."""
    common = {"plant": "qube", "task": "swing_up", "reward": reward}
    without = FurutaEnv(**common, reward_weights={"centred": 0, "calm": 0, "sparing": 0})
    state = (1.5, 0.0, 8.0, -3.0)
    with_all = {
        "centred": ({"centred": 0.9}, lambda plain, full: 0.1 + 0.9 * (2 * plain - 1)),
        "calm": ({"calm": 0.2}, lambda plain, full: 0.8 + 0.2 * (2 * plain - 1)),
        "sparing": ({"sparing": 0.8}, lambda plain, full: 1 - 0.8 * 4 * (1 - plain)),
    }

    def factor(u, **options):
        values = []
        for env in (FurutaEnv(**common, **options), without):
            env.reset(options={"state": state})
            values.append(env.step([u])[1])
        return values[0] / values[1]

    off = dict.fromkeys(with_all, 0.0)
    for name, (weights, expected) in with_all.items():
        plain = factor(8.0, reward_weights={key: w for key, w in off.items() if key != name})
        assert plain < 0.99
        assert factor(8.0, reward_weights=off | weights) == pytest.approx(expected(plain, None), rel=1e-9)
    gentle, was = FurutaEnv(**common, reward_weights=off | {"gentle": 0.6}, reward_scale=0.5), 0.0
    for env in (gentle, without):
        env.reset(options={"state": state})
    for u in (3.0, 3.0, -7.0, 20.0):
        share = (min(u, 10.0) - was) / 10.0
        was = min(u, 10.0)
        expected = 0.5 * (0.4 + 0.6 / (1 + abs(share) / 0.1))
        assert gentle.step([u])[1] == pytest.approx(expected * without.step([u])[1], rel=1e-9)
    inner = factor(0.0, reward_weights=off, arm_limit=2.0, arm_margin=1.0)
    assert inner == pytest.approx(1 - 0.5**2, abs=0.05)  # the arm is near 1.5 rad after the step
    assert factor(0.0, reward_weights=off, arm_limit=2.0, arm_margin=0.4) == 1.0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"reward_weights": {"upright": 1.0}}, "the reward has no 'upright'; it has centred"),
        ({"reward_weights": {"calm": 1.5}}, r"calm must lie in \[0, 1\]"),
        ({"reward_weights": "calm=1"}, "must map"),
        ({"arm_limit": 1.0, "arm_margin": 1.0}, "less than the arm's limit of 1 rad"),
        ({"reward_scale": 0.0}, "reward_scale must lie in"),
    ],
)
def test_bad_rewards_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        FurutaEnv(**options)
