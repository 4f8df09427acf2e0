"""The batch as a stable-baselines3 VecEnv."""

import re
import sys
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor

from furuta_gym.envs import options_of
from furuta_gym.envs.furuta import FurutaEnv
from furuta_gym.envs.sb3 import FurutaVecEnv
from furuta_gym.plant import Plant
from furuta_gym.plant.covariance import Covariance


def test_equal_to_sb3s_own_over_single_envs():
    import gymnasium as gym

    n, steps = 4, 30
    ours = FurutaVecEnv(n, max_episode_steps=steps, normalize_action=True)
    theirs = DummyVecEnv([lambda: gym.make("FurutaID-v0", normalize_action=True, max_episode_steps=steps)] * n)
    for env in (ours, theirs):
        env.seed(3)
    np.testing.assert_array_equal(ours.reset(), theirs.reset())
    rng = np.random.default_rng(0)
    kinds = set()
    for _ in range(100):
        actions = (rng.uniform(-1, 1, (n, 1)) * [[1], [0.01], [1], [0.01]]).astype(np.float32)
        a, b = ours.step(actions), theirs.step(actions)
        for x, y in zip(a[:3], b[:3], strict=True):
            np.testing.assert_array_equal(x, y)
            assert x.dtype == y.dtype
        for i in np.flatnonzero(a[2]):
            np.testing.assert_array_equal(a[3][i]["terminal_observation"], b[3][i]["terminal_observation"])
            assert a[3][i]["TimeLimit.truncated"] == b[3][i]["TimeLimit.truncated"]
            kinds.add(a[3][i]["TimeLimit.truncated"])
    assert kinds == {True, False}


def test_start_states_by_options():
    env = FurutaVecEnv(3)
    env.set_options([{"state": [0.1, 0.02, 0, 0]}, {}, {"state": [0.3, 0.0, 0, 0]}])
    env.reset()
    np.testing.assert_array_equal(env.last_info["state"][[0, 2], 0], [0.1, 0.3])
    first = env.reset()  # options hold for one reset only
    assert not np.isin([0.1, 0.3], env.last_info["state"][:, 0]).any()
    assert first.shape == (3, 5)


@pytest.mark.parametrize("algorithm", [PPO, SAC])
def test_learners_run_on_it(algorithm):
    env = VecMonitor(FurutaVecEnv(8, max_episode_steps=50, normalize_action=True))
    extra = {"n_steps": 16, "batch_size": 64} if algorithm is PPO else {"learning_starts": 50, "buffer_size": 500}
    model = algorithm("MlpPolicy", env, seed=0, device="cpu", policy_kwargs={"net_arch": [16]}, **extra)
    model.learn(512)
    assert model.num_timesteps >= 512
    assert len(model.ep_info_buffer) > 0
    action, _ = model.predict(FurutaEnv(normalize_action=True).reset(seed=0)[0])
    assert np.abs(action) <= 1.0


def test_each_env_has_its_own_spaces_and_plant():
    env, alone = FurutaVecEnv(3, randomize={"theta": "physical:0.2"}), FurutaEnv()
    env.reset()
    assert env.get_attr("action_space") == [alone.action_space] * 3
    assert env.get_attr("observation_space", [1]) == [alone.observation_space]
    drawn = env.get_attr("plant", [0, 2])
    assert [list(p.theta) for p in drawn] == [list(env.batch.plants()[i].theta) for i in (0, 2)]
    assert list(drawn[0].theta) != list(drawn[1].theta)


def test_what_a_batch_cannot_do_is_said():
    env = FurutaVecEnv(2)
    assert env.get_attr("num_envs") == [2, 2]
    with pytest.raises(NotImplementedError, match="share their options"):
        env.set_attr("task", "swing_up")
    with pytest.raises(NotImplementedError, match="no separate envs"):
        env.env_method("render")
    assert env.env_is_wrapped(FurutaEnv) == [False, False]


def test_a_frame_before_the_first_reset_is_refused():
    with pytest.raises(ResetNeeded, match="before render"):
        FurutaVecEnv(2, render_mode="rgb_array").render()


RIGS = """
import gymnasium

spec = gymnasium.spec("FurutaSwingUp-v0")
gymnasium.register(
    "RigOfAModule-v0", spec.entry_point, max_episode_steps=20, kwargs={"task": "swing_up", "action_time": 0.02}
)
"""


def test_ids_of_modules_and_a_time_limit_that_beats_the_ids(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "rigs_of_mine.py").write_text(RIGS)
    monkeypatch.syspath_prepend(str(tmp_path))
    assert options_of("furuta_gym:FurutaSwingUp-v0") == options_of("FurutaSwingUp-v0")
    assert options_of("furuta_gym:FurutaID-v0") == {}
    with pytest.raises(ValueError, match="no environment 'rigs_of_mine:Nothing-v0' here"):
        options_of("rigs_of_mine:Nothing-v0")
    with pytest.raises(ValueError, match=r"No module named 'rigs_of_nobody'.*registers 'Rig-v0'"):
        options_of("rigs_of_nobody:Rig-v0")
    try:
        for limit, actions in (({}, 20), ({"time_limit": 0.6}, 30), ({"time_limit": 0.2}, 10)):
            env = FurutaVecEnv(2, "rigs_of_mine:RigOfAModule-v0", **limit)
            env.reset()
            ends = [bool(env.step(np.zeros((2, 1)))[2][0]) for _ in range(actions)]
            assert ends == [False] * (actions - 1) + [True]
    finally:
        gymnasium.registry.pop("RigOfAModule-v0", None)
        sys.modules.pop("rigs_of_mine", None)


def test_the_page_on_own_scripts_runs_as_it_stands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With fewer steps; the rig's id is the late one."""
    page = (Path(__file__).parents[3] / "docs" / "how-to" / "own_training_script.md").read_text(encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    plant = Plant.resolve("qube")
    known = Covariance(tuple(f"theta{i + 1}" for i in range(9)), np.diag((0.01 * plant.theta) ** 2))
    plant.replace(covariance=known).save("rig.json")
    names: dict[str, Any] = {}
    shapes = []
    try:
        for code in re.findall(r"```python\n(.*?)```", page, re.DOTALL):
            short = re.sub('"MlpPolicy", (env|batch)(, n_steps=32)?', r'"MlpPolicy", \1, n_steps=64', code)
            short = short.replace("200_000", "64")
            exec(short, names)
            shapes.append(names["envs"].observation_space.shape if "envs" in names else None)
        env = gymnasium.make("MyRig-v0")
        assert env.get_wrapper_attr("plant").effect("input_delay").parameters["d"] == 0.015
        assert env.action_space == gymnasium.make("FurutaSwingUp-v0").action_space
        real = gymnasium.make("MyRealRig-v0")
        assert real.get_wrapper_attr("plant").effect("input_delay").parameters["d"] == 0.015
        assert real.observation_space.shape == (18,)
        assert real.get_wrapper_attr("setup").action_period == 0.02
        assert names["observation"].shape == (18,)
        assert (4, 18) in shapes
        assert shapes[-1] == (64, 5)
        own = gymnasium.make_vec("MyRig-v0", num_envs=2, vectorization_mode="vector_entry_point")
        assert own.observation_space.shape == (2, 18)
        assert FurutaVecEnv(2, "MyRig-v0").observation_space.shape == (18,)
        rewarded = names["rewarded"]
        rewarded.reset(seed=0, options={"state": [0.0, 0.0, 0.0, 0.0]})
        for _ in range(5000):
            _, reward, ended, cut, infos = rewarded.step(np.zeros((4, 1)))
            if (ended | cut).any():
                break
        over = ended | cut
        assert reward[over] == pytest.approx(np.cos(infos["final_info"]["state"][over, 1]))
        assert "plant" in names["info"]
    finally:
        for name in ("MyRig-v0", "MyRealRig-v0"):
            gymnasium.registry.pop(name, None)
