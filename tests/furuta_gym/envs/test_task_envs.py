"""FurutaBalance-v0 and FurutaSwingUp-v0: the rig of FurutaID-v0, as learners want it."""

import warnings
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env

import controllers
from controllers import make_controller
from furuta_gym.envs import TASK_IDS
from furuta_gym.envs.furuta import FurutaEnv
from furuta_gym.envs.vector import FurutaVectorEnv
from furuta_gym.plant import LARGE_RIG, QUBE, TABLE_3, Effect

IDS = list(TASK_IDS.values())
POLICIES = Path(controllers.__file__).parent / "policies"


@pytest.mark.parametrize("env_id", IDS)
def test_both_checkers_are_silent(env_id):
    pytest.importorskip("pygame", reason="it draws a picture")
    checker = pytest.importorskip("stable_baselines3.common.env_checker", reason="needs the extra `rl`")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gym.make(env_id).unwrapped)
        checker.check_env(gym.make(env_id, render_mode="rgb_array"))


@pytest.mark.parametrize("env_id", IDS)
def test_as_learners_expect_it(env_id, tmp_path):
    env = gym.make(env_id)
    assert env.action_space == gym.spaces.Box(-1.0, 1.0, (1,), np.float32)
    assert 0 < env.spec.reward_threshold < 1000 * env.unwrapped.setup.options.reward_scale
    assert env.metadata["render_fps"] == 50
    file = QUBE.replace(u_max=7.0, sample_time=0.006).save(tmp_path / "rig.json")
    env = gym.make(env_id, plant=str(file))
    env.reset(seed=0)
    assert env.step(np.ones(1, np.float32))[4]["command"] == 7.0
    setup = env.unwrapped.setup
    assert (setup.samples, setup.sample_time) == (4, 0.006)  # 24 ms: never shorter than asked for
    assert env.metadata["render_fps"] <= 50
    assert setup.longest == round(20.0 / 0.024)


@pytest.mark.parametrize(("stamped", "samples"), [(0.001999, 10), (0.002001, 10), (0.00999, 2), (0.003, 7), (0.019, 2)])
def test_a_clock_read_from_stamps_adds_no_sample(stamped, samples):
    """20 ms are ten samples of a clock whose stamps say 1.999 ms."""
    assert gym.make(IDS[0], plant=QUBE.replace(sample_time=stamped)).unwrapped.setup.samples == samples


@pytest.mark.parametrize(("env_id", "name"), [(IDS[0], "balance-qube.zip"), (IDS[1], "swing-up-qube.zip")])
def test_a_good_policy_reaches_the_threshold(env_id, name):
    env = gym.make(env_id)
    policy = make_controller(str(POLICIES / name), QUBE, env.unwrapped.setup.action_period)
    returns = []
    for seed in range(3):
        _, info = env.reset(seed=seed)
        total, over = 0.0, False
        while not over:
            share = policy(info["measured_state"][:2]) / QUBE.u_max
            _, reward, terminated, truncated, info = env.step(np.array([share], np.float32))
            total, over = total + reward, terminated or truncated
        returns.append(total)
    assert env.spec.reward_threshold < min(returns)
    assert max(returns) <= 100.0


def test_speeds_come_from_every_sample():
    """An action of 20 ms on a clock of 4 ms is five equal actions of FurutaID-v0, observed at the end."""
    fast = FurutaEnv("qube", "swing_up", noise_std=1e-3, delay=0.007)
    slow = gym.make("FurutaSwingUp-v0", reward="smooth", reward_scale=1.0, noise_std=1e-3, delay=0.007).unwrapped
    first = fast.reset(seed=4)[0], slow.reset(seed=4)[0]
    pace = np.sqrt(QUBE.theta[4] / QUBE.theta[3])
    scale = np.array([1, 1, 1, pace, pace])
    np.testing.assert_allclose(first[0], first[1] * scale, rtol=1e-6)
    rng = np.random.default_rng(0)
    for _ in range(40):
        share = rng.integers(-16, 17, 1).astype(np.float32) / 16  # exact in single precision, times 10 too
        for _ in range(5):
            a = fast.step(10.0 * share)
        b = slow.step(share)
        np.testing.assert_allclose(a[0], b[0] * scale, rtol=1e-6)
        np.testing.assert_array_equal(a[4]["measured_state"], b[4]["measured_state"])
        assert a[1] == b[1]


def test_the_tolerant_reward_is_the_documented_one():
    env = gym.make("FurutaSwingUp-v0", reward="tolerant").unwrapped
    omega = np.sqrt(QUBE.theta[4] / QUBE.theta[3])

    def beyond(x, b, w):
        return (max(abs(x) - b, 0.0) / w) ** 2

    rng = np.random.default_rng(0)
    flat = 0
    for i in range(300):
        size = 0.03 if i % 3 == 0 else 1.0
        env.reset(options={"state": rng.uniform(-1, 1, 4) * size * [2, np.pi, 10, 20]})
        _, reward, _, _, info = env.step(rng.uniform(-1, 1, 1) * size)
        q1, q2, v1, v2 = info["state"]
        upright = 0.5 * min((1 + np.cos(q2)) / (1 + np.cos(0.1)), 1)
        upright += 0.5 / (1 + beyond(2 * np.sin(q2 / 2), 0.1, 0.2))
        centred = 0.5 + 0.5 / (1 + beyond(q1, 0.3, 1.0))
        calm = 0.5 + 0.5 / (1 + beyond(np.hypot(v1, v2) / omega, 0.15, 1.0))
        expected = upright * centred * calm * (1 - 0.25 * beyond(info["command"] / 10, 0.3, 0.7))
        assert reward == pytest.approx(0.1 * expected, rel=1e-9)
        flat += reward == 0.1
    assert 20 < flat < 150


def test_starts_within_the_spread():
    spread = np.array([0.5, 0.3, 1.0, 2.0])
    batch = FurutaVectorEnv(2000, "qube", "swing_up", start_spread=tuple(spread))
    state = batch.reset(seed=0)[1]["state"] - [0, np.pi, 0, 0]
    np.testing.assert_allclose(np.abs(state).max(axis=0), spread, rtol=0.01)
    np.testing.assert_allclose(state.std(axis=0), spread / np.sqrt(3), rtol=0.05)


@pytest.mark.parametrize("plant", [QUBE, TABLE_3, LARGE_RIG])
@pytest.mark.parametrize("env_id", IDS)
def test_time_limit_is_in_seconds(env_id, plant):
    env = gym.make(env_id, plant=plant, time_limit=0.4, pendulum_limit=100.0)
    for _ in range(2):
        env.reset(seed=0)
        ends = [env.step(np.zeros(1, np.float32))[2:4] for _ in range(20)]
        assert ends == [(False, False)] * 19 + [(False, True)]


def test_one_end_of_an_episode_for_single_vector_and_sb3():
    """A `time_limit` shortens the thousand actions of FurutaID-v0; one beyond them is refused, not left out."""
    sb3 = pytest.importorskip("furuta_gym.envs.sb3", reason="needs the extra `rl`")
    calm = {"time_limit": 0.2, "pendulum_limit": 100.0}
    single = gym.make("FurutaID-v0", **calm)
    batch = gym.make_vec("FurutaID-v0", num_envs=2, vectorization_mode="vector_entry_point", **calm)
    learners = sb3.FurutaVecEnv(2, **calm)
    single.reset(seed=0)
    batch.reset(seed=0)
    learners.reset()
    for i in range(20):
        ends = [single.step(np.zeros(1))[3], batch.step(np.zeros((2, 1)))[3][1], learners.step(np.zeros((2, 1)))[2][1]]
        assert ends == [i == 19] * 3
    for plant, actions in (("table3", 2000), ("qube", 5000)):
        single = gym.make("FurutaID-v0", plant=plant, time_limit=20.0)
        batch = gym.make_vec(
            "FurutaID-v0", num_envs=2, vectorization_mode="vector_entry_point", plant=plant, time_limit=20.0
        )
        with pytest.raises(ValueError, match=f"after 1000; give max_episode_steps={actions} in its place"):
            batch.reset(seed=0)
        single.reset(seed=0)
        for _ in range(1000):  # the plant may fall, but the id alone ends the episode
            _, _, _, cut, _ = single.step(np.zeros(1, np.float32))
        assert cut
        with pytest.warns(UserWarning, match=f"after 1000. Give gymnasium.make max_episode_steps={actions}"):
            single.reset(seed=0)
    vector = {"num_envs": 2, "vectorization_mode": "vector_entry_point", "time_limit": 20.0}
    gym.make_vec("FurutaID-v0", max_episode_steps=3000, **vector).reset(seed=0)
    with pytest.raises(ValueError, match="after 1500; give max_episode_steps=2000 in its place"):
        gym.make_vec("FurutaID-v0", max_episode_steps=1500, **vector).reset(seed=0)
    gym.make_vec(IDS[0], num_envs=2, vectorization_mode="vector_entry_point", max_episode_steps=500).reset(seed=0)
    short = gym.make(IDS[0], max_episode_steps=5, action_time=0.004)  # 20 s are more than a thousand actions here
    short.reset(seed=0)
    assert [short.step(np.zeros(1, np.float32))[3] for _ in range(5)] == [False] * 4 + [True]


def test_without_a_time_limit_no_episode_of_the_task_ids_is_truncated():
    none = {"time_limit": None, "pendulum_limit": 1e3, "arm_limit": 1e3}
    batch = gym.make_vec("FurutaSwingUp-v0", num_envs=2, vectorization_mode="vector_entry_point", **none)
    single = gym.make("FurutaSwingUp-v0", **none)
    batch.reset(seed=0)
    single.reset(seed=0)
    for _ in range(1010):
        assert not single.step(np.zeros(1, np.float32))[3]
        assert not batch.step(np.zeros((2, 1)))[3].any()


@pytest.mark.parametrize("env_id", IDS)
def test_batch_equals_single_envs(env_id):
    options = {"time_limit": 0.2, "noise_std": 1e-3, "randomize": "theta=physical:0.2 input_delay=uniform:0,0.03"}
    batch = gym.make_vec(env_id, num_envs=3, vectorization_mode="vector_entry_point", **options)
    assert isinstance(batch, FurutaVectorEnv)
    singles = [gym.make(env_id, **options) for _ in range(3)]
    np.testing.assert_array_equal(batch.reset(seed=5)[0], [e.reset(seed=5 + i)[0] for i, e in enumerate(singles)])
    rng = np.random.default_rng(1)
    late = 0
    done = np.zeros(3, dtype=bool)
    for _ in range(60):
        actions = (rng.uniform(-1, 1, (3, 1)) * [[1.0], [0.1], [0.1]]).astype(np.float32)
        ours = batch.step(actions)
        for i, env in enumerate(singles):
            if done[i]:
                np.testing.assert_array_equal(ours[0][i], env.reset()[0])
                done[i] = False
                continue
            theirs = env.step(actions[i])
            np.testing.assert_array_equal(ours[0][i], theirs[0])
            assert tuple(x[i] for x in ours[1:4]) == theirs[1:4]
            late += theirs[3]
            done[i] = theirs[2] or theirs[3]
    assert late > 0


def test_the_spec_of_a_plant_file_has_a_json_though_its_path_is_no_text(tmp_path):
    path = QUBE.save(tmp_path / "rig.json")
    assert isinstance(path, Path)
    env = gym.make("FurutaBalance-v0", plant=path)
    assert EnvSpec.from_json(env.spec.to_json()).kwargs["plant"] == str(path)


def test_the_spec_of_a_plant_of_ones_own_has_a_json_that_makes_the_same_env():
    """A Plant is no JSON; its dictionary is one, and makes the same plant."""
    plant = QUBE.with_effects(Effect("arm_spring", {"k": 0.1, "q1n": 0.2}))
    env = gym.make("FurutaBalance-v0", plant=plant)
    again = gym.make(EnvSpec.from_json(env.spec.to_json()))
    assert again.unwrapped.setup.plant == plant
    np.testing.assert_array_equal(env.reset(seed=3)[0], again.reset(seed=3)[0])
    batch = gym.make_vec("FurutaBalance-v0", num_envs=2, plant=plant)
    twin = gym.make_vec(EnvSpec.from_json(batch.spec.to_json()), num_envs=2)
    assert twin.setup.plant == plant
    with pytest.raises(ValueError, match="not a plant this version can read"):
        gym.make("FurutaBalance-v0", plant={"theta": [1.0]})


def test_one_default_for_single_vector_and_sb3():
    sb3 = pytest.importorskip("furuta_gym.envs.sb3", reason="needs the extra `rl`")
    for env_id in ("FurutaID-v0", *IDS):
        single = gym.make(env_id)
        batch = gym.make_vec(env_id, num_envs=2, vectorization_mode="vector_entry_point")
        ours = sb3.FurutaVecEnv(2, env_id)
        for other in (batch.single_action_space, ours.action_space):
            assert single.action_space == other
        for other in (batch.single_observation_space, ours.observation_space):
            assert single.observation_space == other
    with pytest.raises(ValueError, match="FurutaSwingUp-v0"):
        sb3.FurutaVecEnv(2, "FurutaJuggle-v0")


def test_what_gymnasiums_wrappers_need_is_there(tmp_path):
    pytest.importorskip("moviepy")
    pytest.importorskip("array_api_compat")
    torch = pytest.importorskip("torch")
    from gymnasium.wrappers import RecordVideo
    from gymnasium.wrappers.vector import NumpyToTorch

    env = RecordVideo(gym.make("FurutaSwingUp-v0", render_mode="rgb_array", time_limit=0.2), str(tmp_path / "films"))
    env.reset(seed=0)
    while not any(env.step(env.action_space.sample())[2:4]):
        pass
    env.close()
    assert [file.suffix for file in (tmp_path / "films").iterdir()] == [".mp4"]
    batch = NumpyToTorch(gym.make_vec("FurutaSwingUp-v0", num_envs=2, vectorization_mode="vector_entry_point"))
    assert isinstance(batch.reset(seed=0)[0], torch.Tensor)
    assert batch.step(torch.zeros(2, 1))[1].shape == (2,)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"action_time": 0.0}, "action_time must lie in"),
        ({"time_limit": float("nan")}, "time_limit must lie in"),
        ({"scale_observation": 2}, "True or False"),
        ({"reward": "sparse"}, "smooth, tolerant"),
        ({"start_spread": (1, 2)}, "four half-widths"),
    ],
)
def test_bad_options_say_what_is_allowed(options, message):
    with pytest.raises(ValueError, match=message):
        gym.make("FurutaBalance-v0", **options)
