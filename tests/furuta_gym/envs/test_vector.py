"""The batch against single envs, and Gymnasium's rules for vector environments."""

import gc
import tracemalloc

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from furuta_gym.envs.furuta import FurutaEnv
from furuta_gym.envs.threads import N_BOARD, finish, post, share, take
from furuta_gym.envs.vector import FurutaVectorEnv, _blocks

from .helpers import OPTION_SETS, uncertain


def assert_same(a, b, path="info"):
    """Two infos, masks included, to the last bit."""
    if isinstance(a, dict):
        assert set(a) == set(b), f"{path}: {set(a) ^ set(b)}"
        for key in a:
            assert_same(a[key], b[key], f"{path}.{key}")
    elif a.dtype == object:
        assert [v is None for v in a] == [v is None for v in b], path
        for x, y in zip(a, b, strict=True):
            if x is not None:
                np.testing.assert_array_equal(x, y, err_msg=path)
    else:
        np.testing.assert_array_equal(a, b, err_msg=path)


def pair(n, options, mode=AutoresetMode.NEXT_STEP, steps=40):
    """The compiled batch, and Gymnasium's own over single envs."""
    batch = FurutaVectorEnv(n, autoreset_mode=mode, max_episode_steps=steps, **options)
    single = SyncVectorEnv(
        [lambda: gym.make("FurutaID-v0", max_episode_steps=steps, **options)] * n, autoreset_mode=mode
    )
    return batch, single


def actions_of(env, rng):
    """Half of the envs are pushed hard, so that some episodes terminate and others reach their time limit."""
    size = np.where(np.arange(env.num_envs) % 2, 1.0, 0.02)[:, None]
    return (rng.uniform(-1, 1, (env.num_envs, 1)) * size * env.single_action_space.high).astype(np.float32)


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
@pytest.mark.parametrize("name", OPTION_SETS)
def test_equal_to_single_envs_step_for_step(name, mode):
    batch, single = pair(6, OPTION_SETS[name], mode)
    a, b = batch.reset(seed=11), single.reset(seed=11)
    np.testing.assert_array_equal(a[0], b[0])
    assert_same(a[1], b[1])
    rng = np.random.default_rng(0)
    ended = 0
    for _ in range(130):
        actions = actions_of(batch, rng)
        a, b = batch.step(actions), single.step(actions)
        for ours, theirs in zip(a[:4], b[:4], strict=True):
            np.testing.assert_array_equal(ours, theirs)
            assert ours.dtype == theirs.dtype
        assert_same(a[4], b[4])
        ended += int((a[2] | a[3]).sum())
    assert ended >= 12


def test_seed_list_and_start_states():
    seeds = [5, 900, 5]
    batch = FurutaVectorEnv(3, randomize=True, plant=uncertain())
    observations, info = batch.reset(seed=seeds)
    for i, seed in enumerate(seeds):
        env = FurutaEnv(randomize=True, plant=uncertain())
        observation, single = env.reset(seed=seed)
        np.testing.assert_array_equal(observations[i], observation)
        np.testing.assert_array_equal(info["plant"]["theta"][i], single["plant"]["theta"])
        assert batch.plants([i])[0] == env.plant
    state = np.array([[0.1, 0.2, 0.3, 0.4], [np.nan] * 4, [0, np.nan, 0, 0]])
    drawn = batch.reset(seed=1)[1]["state"]
    given = batch.reset(seed=1, options={"state": state})[1]["state"]
    np.testing.assert_array_equal(given, np.where(np.isnan(state), drawn, state))


def test_without_seeds_envs_differ():
    for seed in (None, [None, 7, None, 7]):
        observations, _ = FurutaVectorEnv(4).reset(seed=seed)
        assert len(np.unique(observations, axis=0)) == (4 if seed is None else 3)  # one angle alone may coincide
    batch = FurutaVectorEnv(2)
    first = batch.reset(seed=[1, 2])[0]
    again = batch.reset(seed=[None, 2])[0]  # the stream of env 0 goes on
    assert first[0, 0] != again[0, 0]
    assert first[1, 0] == again[1, 0]


def test_many_blocks_on_many_threads_equal_one():
    n = 800
    one, many = (FurutaVectorEnv(n, threads=t, noise_std=1e-3, max_episode_steps=20) for t in (1, 3))
    assert one._lanes.shape[0] != many._lanes.shape[0]
    np.testing.assert_array_equal(one.reset(seed=0)[0], many.reset(seed=0)[0])
    rng = np.random.default_rng(0)
    for _ in range(45):
        actions = actions_of(one, rng)
        for a, b in zip(one.step(actions)[:4], many.step(actions)[:4], strict=True):
            np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("n", [1, 2, 100, 128, 129, 255, 256, 1000, 1024, 5000])
def test_blocks_hold_all_envs_in_equal_shares(n):
    for threads in (1, 2, 3) if n >= 256 else (1,):
        blocks, width = _blocks(n, threads)
        assert blocks * width >= n > (blocks - 1) * width
        assert width <= 128
        assert blocks % threads == 0


@pytest.mark.parametrize("threads", [1, 2, 4])
def test_share_does_every_block_of_every_step_once(threads):
    n, board, seen = 10, np.zeros(N_BOARD, dtype=np.int64), []

    def work(patience):
        b = take(board, n, 0)
        while b < n:
            seen.append(b)
            finish(board)
            b = take(board, n, patience)

    for step in range(1, 300):
        share(work, board, n, threads)
        assert len(seen) == n * step
        assert sorted(seen[-n:]) == list(range(n))


def test_what_a_step_returned_stays_as_it_was():
    env = FurutaVectorEnv(300, threads=2, noise_std=1e-3)
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    observation, reward, terminated, truncated, info = env.step(actions_of(env, rng))
    kept = [observation, reward, terminated, truncated, info["state"], info["measured_state"], info["command"]]
    before = [array.copy() for array in kept]
    env.step(actions_of(env, rng))
    for array, copy in zip(kept, before, strict=True):
        np.testing.assert_array_equal(array, copy)


def test_threads_that_wait_for_the_next_step_find_it_whole():
    n, steps = 512, 3000
    one, many = (FurutaVectorEnv(n, threads=t, noise_std=1e-3, max_episode_steps=None) for t in (1, 4))
    rng, sums = np.random.default_rng(1), []
    actions = [rng.uniform(-0.2, 0.2, (n, 1)).astype(np.float32) for _ in range(7)]
    for env in (one, many):
        env.reset(seed=0)
        total = np.zeros(n)
        for i in range(steps):
            total += env.step(actions[i % 7])[1]
        sums.append(total)
    np.testing.assert_array_equal(*sums)


def test_a_new_level_holds_in_a_thread_that_waits_at_the_board_of_the_last_step(monkeypatch):
    works = []

    def by_who_waited(work, board, n, threads):
        works.append(work)
        post(board)
        works[-2 if len(works) > 1 else -1](0)  # takes every block of this step with what it was given for the last one

    monkeypatch.setattr("furuta_gym.envs.vector.share", by_who_waited)
    env = FurutaVectorEnv(1024, "qube", randomize="arm_spring.k=uniform:1,2", max_episode_steps=1, threads=2)
    env.reset(seed=0)
    actions = np.zeros((1024, 1), dtype=np.float32)
    for level in (1.0, 0.0, 1.0):
        env.step(actions)  # ends every episode
        env.set_level(level)
        k = env.step(actions)[4]["plant"]["effects"]["arm_spring"]["k"]
        assert (k > 1.0).all() if level else (k == 1.0).all()


def test_a_snapshot_is_the_same_and_goes_on_on_any_number_of_threads():
    options = {"noise_std": 1e-3, "delay": 0.012, "max_episode_steps": 7, "plant": uncertain(), "randomize": True}
    first, second = FurutaVectorEnv(300, threads=1, **options), FurutaVectorEnv(300, threads=2, **options)
    assert first._lanes.shape != second._lanes.shape
    rng = np.random.default_rng(0)
    for env in (first, second):
        env.reset(seed=3)
    for _ in range(5):
        actions = actions_of(first, rng)
        first.step(actions)
    kept = first.snapshot()
    second.restore(kept)
    for name, value in second.snapshot().items():
        np.testing.assert_array_equal(value, kept[name], err_msg=name)
    for _ in range(20):
        actions = actions_of(first, rng)
        for a, b in zip(first.step(actions)[:4], second.step(actions)[:4], strict=True):
            np.testing.assert_array_equal(a, b)
    with pytest.raises(ValueError, match="lanes must be"):
        second.restore(kept | {"lanes": kept["lanes"][:, :-1]})


def test_next_step_autoreset_ignores_the_action_and_gives_no_reward():
    batch = FurutaVectorEnv(2, max_episode_steps=5)
    batch.reset(seed=0)
    for _ in range(5):
        _, _, terminated, truncated, _ = batch.step(np.zeros((2, 1)))
    assert truncated.all()
    assert not terminated.any()
    first = batch.step(np.full((2, 1), 9.0))
    assert (first[1] == 0).all()
    assert not (first[2] | first[3]).any()
    assert (first[4]["command"] == 0).all()


def test_terminated_and_truncated_are_apart():
    batch = FurutaVectorEnv(3, max_episode_steps=8)
    batch.reset(options={"state": [[0, 0, 0, 0], [0, 0.49, 0, 2.0], [0, 0, 0, 0]]})
    seen = []
    for _ in range(8):
        _, _, terminated, truncated, _ = batch.step(np.zeros((3, 1)))
        seen.append((terminated.copy(), truncated.copy()))
    assert seen[0][0].tolist() == [False, True, False]
    assert seen[-1][1].tolist() == [True, False, True]  # env 1 had begun anew
    assert not seen[-1][0].any()


def test_disabled_autoreset_needs_a_mask():
    batch = FurutaVectorEnv(4, autoreset_mode="Disabled", max_episode_steps=3)
    assert batch.metadata["autoreset_mode"] is AutoresetMode.DISABLED
    with pytest.raises(ResetNeeded, match="every environment"):
        batch.reset(options={"reset_mask": np.array([True, False, False, False])})
    batch.reset(seed=0)
    batch.reset(options={"state": [0, 0.49, 0, 2.0], "reset_mask": np.array([True, False, False, True])})
    observations, _, terminated, _, _ = batch.step(np.zeros((4, 1)))
    assert terminated.tolist() == [True, False, False, True]
    with pytest.raises(ResetNeeded, match="2 episodes have ended"):
        batch.step(np.zeros((4, 1)))
    again, info = batch.reset(options={"reset_mask": terminated})
    np.testing.assert_array_equal(again[~terminated], observations[~terminated])
    assert (again[terminated] != observations[terminated]).any()
    assert info["_state"].tolist() == terminated.tolist()
    batch.step(np.zeros((4, 1)))


@pytest.mark.parametrize(
    "mask",
    [np.zeros(3, dtype=bool), np.ones(2, dtype=bool), np.ones(3), [[True] * 3]],
    ids=["none", "short", "float", "2d"],
)
def test_bad_masks_are_refused(mask):
    batch = FurutaVectorEnv(3)
    batch.reset(seed=0)
    with pytest.raises(ValueError, match="reset_mask"):
        batch.reset(options={"reset_mask": mask})


def test_made_by_make_vec():
    envs = gym.make_vec(
        "FurutaID-v0", num_envs=7, vectorization_mode="vector_entry_point", task="swing_up", max_episode_steps=30
    )
    assert isinstance(envs, FurutaVectorEnv)
    assert envs.spec.kwargs["max_episode_steps"] == 30
    assert envs.action_space.shape == (7, 1)
    assert envs.observation_space.shape == (7, 5)
    observations, _ = envs.reset(seed=1)
    assert observations in envs.observation_space
    envs = gym.wrappers.vector.RecordEpisodeStatistics(envs)
    envs.reset(seed=1)
    for _ in range(30):
        info = envs.step(envs.action_space.sample())[4]
    assert (info["episode"]["l"] == 30).all()
    envs.close()
    other = gym.make_vec(
        "FurutaID-v0", 2, "vector_entry_point", autoreset_mode=AutoresetMode.SAME_STEP, render_mode="rgb_array"
    )
    assert other.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP


def test_returned_arrays_are_the_callers():
    batch = FurutaVectorEnv(4)
    first, info = batch.reset(seed=0)
    kept, state = first.copy(), info["state"].copy()
    results = [batch.step(np.zeros((4, 1))) for _ in range(3)]
    np.testing.assert_array_equal(first, kept)
    np.testing.assert_array_equal(info["state"], state)
    results[0][0][:] = 99.0
    results[0][4]["state"][:] = 99.0
    assert batch.step(np.zeros((4, 1)))[0].max() < 50


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"num_envs": 0}, "num_envs"),
        ({"num_envs": 2.5}, "num_envs"),
        ({"max_episode_steps": 0}, "max_episode_steps"),
        ({"render_mode": "human"}, "rgb_array"),
        ({"threads": 0}, "threads"),
        ({"autoreset_mode": "Sometimes"}, "Sometimes"),
        ({"task": "juggle"}, "balance, swing_up"),
    ],
)
def test_bad_arguments(options, message):
    with pytest.raises(ValueError, match=message):
        FurutaVectorEnv(**options)


def test_what_could_not_be_made_can_be_closed():
    FurutaVectorEnv.__new__(FurutaVectorEnv).close()  # as Gymnasium 1.1 does when an argument was refused


def test_bad_calls():
    batch = FurutaVectorEnv(3)
    with pytest.raises(ResetNeeded):
        batch.step(np.zeros((3, 1)))
    with pytest.raises(ResetNeeded, match="before render"):
        FurutaVectorEnv(3, render_mode="rgb_array").render()
    assert batch.render() is None
    with pytest.raises(ValueError, match="list of 3"):
        batch.reset(seed=[1, 2])
    with pytest.raises(ValueError, match=r"shape \(4,\) or \(3, 4\)"):
        batch.reset(options={"state": np.zeros((2, 4))})
    batch.reset(seed=0)
    with pytest.raises(ValueError, match=r"shape \(3, 1\), got \(3,\)"):
        batch.step(np.zeros(3))
    with pytest.raises(ValueError, match="NaN"):
        batch.step(np.array([[0.0], [np.nan], [0.0]]))


def test_memory_stays_flat():
    """A small version of the benchmark's run over 10⁷ env steps, with everything on that could grow."""
    batch = FurutaVectorEnv(
        512, max_episode_steps=30, delay=0.01, noise_std=1e-3, autoreset_mode=AutoresetMode.SAME_STEP,
        plant=uncertain(), randomize=True,
    )  # fmt: skip
    batch.reset(seed=0)
    actions = np.zeros((512, 1), dtype=np.float32)

    def run(steps):
        for _ in range(steps):
            batch.step(actions)
        gc.collect()

    run(100)
    tracemalloc.start()
    run(50)
    before, _ = tracemalloc.get_traced_memory()
    run(300)
    after, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert after - before < 50_000
