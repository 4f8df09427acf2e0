"""What an environment says of options that contradict each other, of starts out of reach, and of uncertain plants."""

from __future__ import annotations

import json
import pickle
import warnings
from itertools import product

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from furuta_gym.envs.sb3 import FurutaVecEnv
from furuta_gym.envs.vector import FurutaVectorEnv
from furuta_gym.plant import QUBE, Effect

ID = "FurutaID-v0"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"delay": 0.02, "randomize": "input_delay=uniform:0,0.001"}, "randomize draws it"),
        ({"delay": 0.01, "randomize": "input_delay=chance:0.5:uniform:0.02,0.03"}, "randomize draws it"),
        ({"noise_std": 0.05, "randomize": "noise_std=0.0"}, "randomize draws it"),
        ({"encoder_offset": (0.1, 0.0), "randomize": "encoder_offset=uniform:-0.1,0.1"}, "randomize draws it"),
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


def test_an_env_that_draws_what_its_plant_says_has_a_spec_and_can_be_copied():
    plant = QUBE.replace(randomize={"theta": "physical:0.1"})
    env = gymnasium.make(ID, plant=plant, randomize=plant.randomize)
    assert json.loads(env.unwrapped.spec.to_json())["kwargs"]["randomize"] == {"theta": "physical:0.1"}
    again = gymnasium.make(env.spec)
    twin = pickle.loads(pickle.dumps(env.unwrapped))
    seen = [e.reset(seed=3)[0].tolist() for e in (env, again, twin)]
    assert seen[0] == seen[1] == seen[2]


@pytest.mark.parametrize("mode", ["SAME_STEP", "SameStep", AutoresetMode.SAME_STEP])
def test_an_autoreset_mode_by_its_name(mode: AutoresetMode | str):
    assert FurutaVectorEnv(2, autoreset_mode=mode).autoreset_mode is AutoresetMode.SAME_STEP
    with pytest.raises(ValueError, match="NEXT_STEP, SAME_STEP, DISABLED"):
        FurutaVectorEnv(2, autoreset_mode="sometimes")


def test_an_observed_command_is_what_the_computer_sends():
    """No computer knows that its supply is weak: 10 V were sent, 4 V arrived."""
    for limits in ({}, {"slew": 2500.0}):
        plant = QUBE.replace(limits=limits, sample_time=0.004)
        env = gymnasium.make(ID, plant=plant, observe_command=True, randomize="u_max=4.0")
        env.reset(seed=0)
        seen, _, _, _, info = env.step(np.full(1, 10.0, np.float32))
        assert seen[5] == 1.0
        assert info["command"] == 4.0


def test_a_curriculum_begins_with_what_the_plant_itself_has():
    late = QUBE.with_effects(Effect("input_delay", {"d": 0.012}))
    ways = ({"effect_probabilities": {"input_delay": 0.5}}, {"randomize": "input_delay=chance:0.5:uniform:0,0.03"})
    for (plant, at_zero), way in product(((late, 0.012), (QUBE, 0.0)), ways):
        env = gymnasium.make(ID, plant=plant, **way).unwrapped
        env.set_level(0.0)
        drawn = {env.reset(seed=i)[1]["plant"]["effects"]["input_delay"]["d"] for i in range(8)}
        assert drawn == {at_zero}
        env.set_level(1.0)
        assert len({env.reset(seed=i)[1]["plant"]["effects"]["input_delay"]["d"] for i in range(20)}) > 1


def test_an_arm_that_may_hardly_turn_starts_within_its_limit():
    env = gymnasium.make(ID, arm_limit=0.1)
    starts = [env.reset(seed=i)[1]["state"][0] for i in range(50)]
    assert 0.03 < np.abs(starts).max() <= 0.05


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
