"""What an environment says of options that contradict each other, of starts out of reach, and of uncertain plants."""

from __future__ import annotations

import json
import warnings

import gymnasium
import numpy as np
import pytest

from furuta_gym.envs.sb3 import FurutaVecEnv
from furuta_gym.envs.vector import FurutaVectorEnv
from furuta_gym.plant import QUBE

ID = "FurutaID-v0"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"delay": 0.02, "randomize": "input_delay=uniform:0,0.001"}, "randomize draws it"),
        ({"noise_std": 0.05, "randomize": "noise_std=0.0"}, "randomize draws it"),
        ({"jitter": 0.1, "randomize": "jitter=uniform:0,0.2"}, "randomize draws it"),
        (
            {"randomize": "input_delay=chance:0.3", "effect_probabilities": {"input_delay": 1.0}},
            "randomize gives its chance too",
        ),
        ({"start_spread": "abcd"}, "start_spread must be four"),
    ],
)
def test_what_is_given_twice_or_cannot_be_is_refused(options: dict[str, object], words: str):
    with pytest.raises(ValueError, match=words):
        gymnasium.make(ID, **options)


@pytest.mark.parametrize("options", [{"threads": 2.7}, {"threads": "a"}, {"max_episode_steps": 2.5}])
def test_a_batch_asks_for_whole_numbers(options: dict[str, object]):
    with pytest.raises(ValueError, match="whole number"):
        FurutaVectorEnv(2, **options)


@pytest.mark.parametrize("state", [[0, 3.1, 0, 5e3], [0, 1e18, 0, 0], [100, 0, 0, 0]])
def test_a_start_that_no_observation_can_show_is_refused(state: list[float]):
    env = gymnasium.make(ID)
    with pytest.raises(ValueError, match="out of reach"):
        env.reset(options={"state": state})
    with pytest.raises(ValueError, match="out of reach"):
        FurutaVectorEnv(2).reset(options={"state": state})


def test_a_longer_time_limit_is_told_only_where_the_id_ends_an_episode():
    options = {"task": "swing_up", "time_limit": 0.02, "sample_time": 0.002}
    id_of_two = gymnasium.spec(ID)
    gymnasium.register("FurutaOfFive-v0", entry_point=id_of_two.entry_point, max_episode_steps=5)
    try:
        for limit, told in ((10, False), (None, True)):
            env = gymnasium.make("FurutaOfFive-v0", **({"max_episode_steps": limit} if limit else {}), **options)
            with warnings.catch_warnings(record=True) as said:
                warnings.simplefilter("always")
                env.reset(seed=0)
                ended = False
                while not ended:
                    *_, terminated, truncated, _ = env.step(np.zeros(1, np.float32))
                    ended = terminated or truncated
                env.reset()
            assert bool([w for w in said if "ended the episode after 5" in str(w.message)]) is told
    finally:
        del gymnasium.registry["FurutaOfFive-v0"]


def test_a_spec_with_arrays_has_a_json():
    env = gymnasium.make(ID, start_spread=np.full(4, 0.1), history=np.int64(3), randomize={"noise_std": np.float64(0)})
    env.unwrapped.spec.to_json()
    assert json.loads(env.unwrapped.spec.to_json())["kwargs"]["start_spread"] == [0.1] * 4


def test_a_plant_that_its_log_did_not_show_is_told():
    checks = {"identifiability": {"level": "poor", "not_identified": ["theta2", "theta6"], "weak": []}}
    plant = QUBE.replace(checks=checks)
    with pytest.warns(UserWarning, match="did not show θ2, θ6"):
        gymnasium.make(ID, plant=plant)
    with pytest.warns(UserWarning, match="did not show θ2, θ6"):
        gymnasium.make_vec(ID, 2, vectorization_mode="vector_entry_point", plant=plant)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        gymnasium.make(ID, plant=plant, randomize="theta=physical:0.2")  # drawn widely anyway


def test_a_masked_reset_tells_nothing_of_the_others():
    env = FurutaVectorEnv(3, autoreset_mode="Disabled")
    env.reset(seed=0)
    _, info = env.reset(options={"reset_mask": np.array([False, True, False])})
    assert not info["state"][[0, 2]].any()
    assert info["state"][1].any()


def test_a_batch_for_stable_baselines_hands_on_infos_and_the_level():
    batch = FurutaVecEnv(2, "FurutaSwingUp-v0", plant="qube", randomize="theta=physical:0.2", time_limit=0.06)
    batch.reset()
    first = [info["plant"]["theta"].copy() for info in batch.reset_infos]
    assert not np.allclose(first[0], first[1])
    batch.env_method("set_level", 0.0)
    done = np.zeros(2, bool)
    while not done.all():
        _, _, done, infos = batch.step(np.zeros((2, 1), np.float32))
    assert infos[0]["state"].shape == (4,)
    assert isinstance(float(infos[0]["command"]), float)
    np.testing.assert_allclose([info["plant"]["theta"] for info in batch.reset_infos], [QUBE.theta] * 2)
